#include "app/base/backends.h"

#include <stdlib.h>
#include <string.h>

#include "fsn/emulated.h"
#include "fsn/version.h"
#include "plan/try.h"

/** The emulated bus is created from its plan, so it is created when it is opened. */
struct memory {
    struct fsn_emulated *bus;
};

static fsn_status memory_open(void *context, const struct fsn_plan *plan,
                              struct fsn_bus_layout *layout, struct fsn_fault *fault) {
    struct memory *memory = context;
    FSN_TRY(fsn_emulated_create(plan, &memory->bus));
    return fsn_emulated_ops()->open(memory->bus, plan, layout, fault);
}

static void memory_receive(void *context, struct fsn_bus_input *input) {
    fsn_emulated_ops()->receive(((struct memory *)context)->bus, input);
}

static void memory_send(void *context) {
    fsn_emulated_ops()->send(((struct memory *)context)->bus);
}

static void memory_close(void *context) {
    struct memory *memory = context;
    if (fsn_emulated_ops()->close != NULL) {
        fsn_emulated_ops()->close(memory->bus);
    }
    fsn_emulated_free(memory->bus);
    memory->bus = NULL;
}

static const struct fsn_bus_ops memory_ops = {
    .name = "emulated",
    .open = memory_open,
    .receive = memory_receive,
    .send = memory_send,
    .close = memory_close,
};

static fsn_status memory_create(const struct fsn_live_options *options, void **bus,
                                struct fsn_fault *fault) {
    (void)options;
    (void)fault;
    struct memory *memory = calloc(1, sizeof *memory);
    *bus = memory;
    return memory != NULL ? FSN_OK : FSN_E_NOMEM;
}

static void memory_free(void *bus) {
    struct memory *memory = bus;
    if (memory != NULL) {
        fsn_emulated_free(memory->bus);
        free(memory);
    }
}

static const struct fsn_backend memory_backend = {
    .name = "emulated",
    .about = "An image in memory without SubDevices; to try options and socket.",
    .ops = &memory_ops,
    .create = memory_create,
    .free = memory_free,
};

static const char *const known[] = {"soem", "igh", "emulated"};

const struct fsn_backend *backend_find(const char *name) {
#ifdef FSN_HAVE_SOEM
    if (strcmp(name, "soem") == 0) {
        return fsn_backend_soem();
    }
#endif
#ifdef FSN_HAVE_IGH
    if (strcmp(name, "igh") == 0) {
        return fsn_backend_igh();
    }
#endif
    return strcmp(name, "emulated") == 0 ? &memory_backend : NULL;
}

bool backend_is_known(const char *name) {
    for (size_t i = 0; i < sizeof known / sizeof known[0]; i++) {
        if (strcmp(name, known[i]) == 0) {
            return true;
        }
    }
    return false;
}

void backends_print(FILE *out) {
    fprintf(out, "fsn-master %s\n", fsn_version());
    for (size_t i = 0; i < sizeof known / sizeof known[0]; i++) {
        const struct fsn_backend *backend = backend_find(known[i]);
        fprintf(out, "\nbus %s: %s\n", known[i],
                backend != NULL ? backend->about : "not in this build");
    }
    fputs("\nPart of the black channel: it moves FSoE frames whole and unchanged, and makes none. "
          "It is\nnot a safety function, holds no certificate, and its stop is not an emergency "
          "stop.\n",
          out);
}
