/** A build for test rigs accepts a real interface, but only with an explicit option. */
#include "segment_rig.h"

int main(void) {
    struct rig rig = set_up();
    struct fsn_segment_link_options lo = {.interface = "lo"};
    CHECK(fsn_segment_test_rig());
    const fsn_status without = fsn_segment_link(rig.segment, &lo, NULL);
    CHECK(without == FSN_E_ARG || without == FSN_E_SYS); /* SYS where raw sockets are not allowed */
    lo.no_machine_on_this_wire = true;
    CHECK(fsn_segment_link(rig.segment, &lo, NULL) == (without == FSN_E_ARG ? FSN_OK : FSN_E_SYS));
    fsn_segment_unlink(rig.segment);
    tear_down(&rig);
    return 0;
}
