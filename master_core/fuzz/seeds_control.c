#include <string.h>

#include "fuzz.h"

/** The symbol of build_full() is called "t". */
uint8_t *fuzz_seed(size_t number, size_t *len) {
    static const char *const seeds[] = {
        "hello\nstatus\nsubdevices\nsymbols\nsnapshot\nhelp\n",
        "events on\nlease 500\nset t=1\nget t t\narm t\nset t=0x5a\nevents off\nget t\n",
        "watch 1\nlayout\nwatch 2 --image\nwatch 1 t* t\nevents on\nstatus\nwatch off\nget t\n",
        "watch 1000000 t\nwatch 0\nwatch 1 x*\nwatch 1 --typed\nwatch off t\nwatch 3 *\nhello\n",
        "#7 set \"t\"=255\n#a stop\nrestart\nstart\nlease 0\nshutdown\nset t=1 t=2\nset t=256\n",
        "sdo-read t 0x1018 1 uint32\nscan\n#x sdo-read t 0x1008 0 string\nsii-read t\n",
        "realtime 1 any 3 t*\nrealtime begin\nstatus\nset t=1\nrealtime 1 any 0\n",
        "history t\nalias-write t 5\nsdo-write t 0x2000 0 int8 -1\nscan\n",
    };
    if (number >= sizeof seeds / sizeof seeds[0]) {
        return NULL;
    }
    *len = strlen(seeds[number]);
    uint8_t *bytes = malloc(*len);
    CHECK(bytes != NULL);
    memcpy(bytes, seeds[number], *len);
    return bytes;
}
