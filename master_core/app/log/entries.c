#define _GNU_SOURCE

#include "app/log/entries.h"

#include <fcntl.h>
#include <stdio.h>
#include <unistd.h>

#include "app/log/log.h"
#include "control/base/clock.h"
#include "control/base/json.h"
#include "control/base/peer.h"
#include "control/base/words.h"
#include "fsn/version.h"
#include "plan/plan_internal.h"

enum { MOST_BYTES = 256 << 10 };

static void begin(struct fsn_json *json, const char *event) {
    *json = (struct fsn_json){.limit_bytes = MOST_BYTES};
    fsn_json_begin_event(json, event, fsn_now_ns());
}

static void end(struct fsn_json *json, const char *level, const char *text) {
    fsn_json_end_event(json, level, text);
    log_entry(FSN_MAINTAINER, json);
    fsn_json_free(json);
}

/** SHA-256 of the file of this program; empty if it cannot be read. */
static void hash_program(char hash[2 * FSN_SHA256_BYTES + 1]) {
    uint8_t digest[FSN_SHA256_BYTES];
    const int fd = open("/proc/self/exe", O_RDONLY | O_CLOEXEC);
    const bool hashed = fd >= 0 && fsn_sha256_file(fd, digest) == 0;
    fsn_hex_text(digest, hashed ? sizeof digest : 0, hash);
    if (fd >= 0) {
        close(fd);
    }
}

void entry_start(int argc, char **argv) {
    struct fsn_json json;
    struct fsn_peer self;
    char hash[2 * FSN_SHA256_BYTES + 1];
    char host[256] = "";
    char who[FSN_PEER_TEXT_BYTES];
    char text[320];
    hash_program(hash);
    fsn_peer_read(&self, getpid(), getuid());
    gethostname(host, sizeof host - 1);
    begin(&json, "start");
    fsn_json_put_text(&json, "version", fsn_version());
    fsn_json_put_text(&json, "program_sha256", hash[0] != 0 ? hash : NULL);
    fsn_json_put_text(&json, "host", host);
    fsn_peer_put(&self, &json);
    fsn_json_put_open(&json, "arguments", '[');
    for (int i = 1; i < argc; i++) {
        fsn_json_text(&json, argv[i]);
    }
    fsn_json_close(&json, ']');
    snprintf(text, sizeof text, "fsn-master %s starts: %s", fsn_version(),
             fsn_peer_text(&self, who));
    end(&json, "info", text);
}

void entry_plan(const struct fsn_plan *plan, const struct options *o) {
    struct fsn_json json;
    struct fsn_fingerprint made;
    uint8_t digest[FSN_SHA256_BYTES];
    char code[FSN_FINGERPRINT_CODE_BYTES] = "";
    char text[400];
    fsn_plan_sha256(plan, digest);
    begin(&json, "plan");
    fsn_json_put_text(&json, "plan", o->plan_file);
    fsn_json_put_hex(&json, "sha256", digest, sizeof digest);
    fsn_json_put_open(&json, "fingerprint", '{');
    if (fsn_plan_fingerprint(plan, &made) == FSN_OK) {
        fsn_fingerprint_code(&made, code);
        fsn_json_put_text(&json, "form", FSN_FINGERPRINT_FORM);
        fsn_json_put_text(&json, "short", code);
        fsn_json_put_hex(&json, "whole", made.whole, sizeof made.whole);
    }
    fsn_json_close(&json, '}');
    fsn_json_put_u64(&json, "plan_cycle_ns", fsn_plan_cycle_ns(plan));
    FSN_JSON_PUT(&json, o, accepted, acceptance);
    const char *acceptance = "no acceptance required";
    if (o->acceptance != NULL) {
        acceptance = "to be accepted by a signed record";
    } else if (o->accepted != NULL) {
        acceptance = "to be accepted by its hash";
    }
    snprintf(text, sizeof text, "plan %.200s, fingerprint %s, %s", o->plan_file, code, acceptance);
    end(&json, "info", text);
}

void entry_acceptance(const struct options *o, bool as_signed, const char *text) {
    struct fsn_json json;
    begin(&json, "acceptance");
    fsn_json_put_text(&json, "record", o->acceptance);
    FSN_JSON_PUT(&json, o, signers, revoked);
    fsn_json_put_bool(&json, "as_signed", as_signed);
    end(&json, as_signed ? "info" : "error", text);
}
