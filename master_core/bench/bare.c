#include "bare.h"

#include "builder.h"

void bare_bring_up(struct bare *b, int devices) {
    b->context = (ecx_contextt){.port = &b->port,
                                .slavelist = b->slaves,
                                .slavecount = &b->count,
                                .maxslave = MOST_SLAVES,
                                .grouplist = b->groups,
                                .maxgroup = 1,
                                .esibuf = b->esi,
                                .esimap = b->esi_map,
                                .elist = &b->errors,
                                .idxstack = &b->stack,
                                .ecaterror = &b->error,
                                .DCtime = &b->time,
                                .SMcommtype = &b->comm,
                                .PDOassign = &b->assign,
                                .PDOdesc = &b->desc,
                                .eepSM = &b->sm,
                                .eepFMMU = &b->fmmu};
    CHECK(ecx_init(&b->context, "near") > 0 && ecx_config_init(&b->context, FALSE) == devices);
    CHECK(ecx_config_map_group(&b->context, b->image, 0) > 0);
    ecx_configdc(&b->context);
    CHECK(ecx_statecheck(&b->context, 0, EC_STATE_SAFE_OP, 2000000) == EC_STATE_SAFE_OP);
    ecx_send_processdata(&b->context);
    ecx_receive_processdata(&b->context, EC_TIMEOUTRET);
    b->slaves[0].state = EC_STATE_OPERATIONAL;
    ecx_writestate(&b->context, 0);
    CHECK(ecx_statecheck(&b->context, 0, EC_STATE_OPERATIONAL, 2000000) == EC_STATE_OPERATIONAL);
}

void bare_end(struct bare *b) {
    b->slaves[0].state = EC_STATE_INIT;
    ecx_writestate(&b->context, 0);
    ecx_close(&b->context);
}
