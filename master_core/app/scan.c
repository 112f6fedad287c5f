#include "app/master.h"

#include <errno.h>
#include <stdio.h>

#include "app/base/explain.h"
#include "app/log/log.h"
#include "control/survey/survey.h"

static int refused(const struct fsn_fault *fault, const struct options *options) {
    char text[1200];
    explain_bus_fault(fault, NULL, options, text, sizeof text);
    log_line(FSN_LOG_ERROR, "%s", text);
    return fault->status == FSN_E_SYS || fault->status == FSN_E_NOMEM || fault->sys_errno == EPERM
               ? EXIT_ENVIRONMENT
               : EXIT_REFUSED;
}

static int print(const struct fsn_survey *survey) {
    struct fsn_json json = {.limit_bytes = FSN_SURVEY_BYTES};
    fsn_json_open(&json, '{');
    const fsn_status status = fsn_survey_write(survey, &json);
    fsn_json_close(&json, '}');
    fsn_json_end(&json);
    int code = EXIT_FINE;
    if (status != FSN_OK || json.failed != FSN_OK) {
        log_line(FSN_LOG_ERROR, "the scan ended early: %s",
                 fsn_status_text(status != FSN_OK ? status : json.failed));
        code = EXIT_ENVIRONMENT;
    } else if (fwrite(json.bytes, 1, json.len_bytes, stdout) != json.len_bytes ||
               fflush(stdout) != 0) {
        log_line(FSN_LOG_ERROR, "stdout is full or closed; write to another place");
        code = EXIT_ENVIRONMENT;
    }
    fsn_json_free(&json);
    return code;
}

int scan_run(const struct options *options, const struct fsn_backend *backend) {
    const struct fsn_live_options live = {.interface = options->interface,
                                          .redundant = options->redundant};
    struct fsn_fault fault = {.copy_index = FSN_FAULT_NO_RECORD};
    void *bus = NULL;
    struct fsn_survey survey = {.ops = backend->ops, .interface = options->interface};
    if (backend->ops->acyclic == NULL || backend->ops->acyclic->visit == NULL) {
        log_line(FSN_LOG_ERROR, "FSN_E_ABSENT: bus %s cannot be scanned; --bus soem can",
                 backend->name);
        return EXIT_REFUSED;
    }
    fsn_status status = backend->create(&live, &bus, &fault);
    if (status == FSN_OK) {
        status = backend->ops->acyclic->visit(bus, &survey.states_changed, &fault);
    }
    int code;
    if (status == FSN_OK) {
        survey.bus = bus;
        code = print(&survey);
        backend->ops->acyclic->quit(bus);
    } else {
        code = refused(&fault, options);
    }
    backend->free(bus);
    return code;
}
