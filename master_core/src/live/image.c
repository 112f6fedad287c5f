#include "live/image.h"

#include <stdlib.h>

static bool allocate(const struct fsn_plan *plan, struct fsn_image *image) {
    const uint32_t sms = plan->count[FSN_SEC_SM];
    *image = (struct fsn_image){0};
    return FSN_NEW(image->sm_base, sms) && FSN_NEW(image->sm_datagram, sms) &&
           FSN_NEW(image->datagram_begin, sms) && FSN_NEW(image->expected, sms);
}

/** Number of bytes that a sync manager needs in the image; 0 if it has no place. */
static uint32_t size_of(const struct fsn_plan *plan, uint32_t sm) {
    struct fsn_sm_info info;
    return fsn_plan_sm(plan, sm, &info) == FSN_OK && info.registered ? info.size_bytes : 0;
}

/** Appends one sync manager; false if it is longer than a datagram may be. */
static bool append(const struct fsn_plan *plan, uint32_t sm, uint32_t datagram_bytes,
                   struct fsn_image *image) {
    const uint32_t size = size_of(plan, sm);
    if (size > datagram_bytes) {
        return false;
    }
    const uint32_t last = image->datagram_count - 1;
    const uint32_t used = image->bytes - image->datagram_begin[last];
    if (used > 0 && used + size > datagram_bytes) {
        image->datagram_begin[image->datagram_count++] = image->bytes;
    }
    image->sm_base[sm] = image->bytes;
    image->sm_datagram[sm] = image->datagram_count - 1;
    image->bytes += size;
    return true;
}

static bool append_subdevice(const struct fsn_plan *plan, uint32_t subdevice,
                             uint32_t datagram_bytes, struct fsn_image *image) {
    const struct fsn_subdevice_info info = fsn_known_subdevice(plan, subdevice);
    for (uint8_t direction = FSN_OUTPUT; direction <= FSN_INPUT; direction++) {
        for (uint32_t sm = info.first_sm; sm < info.first_sm + info.sm_count; sm++) {
            if (size_of(plan, sm) > 0 && fsn_read_sm(plan, sm).direction == direction &&
                !append(plan, sm, datagram_bytes, image)) {
                return false;
            }
        }
    }
    return true;
}

uint32_t fsn_image_wkc(const struct fsn_plan *plan, const struct fsn_image *image, uint32_t sm) {
    const struct fsn_sm_info info = fsn_known_sm(plan, sm);
    const struct fsn_subdevice_info sub = fsn_known_subdevice(plan, info.subdevice);
    if (image->sm_base[sm] == FSN_NONE) {
        return 0;
    }
    for (uint32_t other = sub.first_sm; other < sm; other++) {
        if (image->sm_base[other] != FSN_NONE &&
            image->sm_datagram[other] == image->sm_datagram[sm] &&
            fsn_read_sm(plan, other).direction == info.direction) {
            return 0;
        }
    }
    return info.direction == FSN_OUTPUT ? 2 : 1;
}

fsn_status fsn_image_create(const struct fsn_plan *plan, uint32_t datagram_bytes,
                            struct fsn_image *image) {
    if (!allocate(plan, image)) {
        fsn_image_free(image);
        return FSN_E_NOMEM;
    }
    image->datagram_count = 1;
    for (uint32_t sm = 0; sm < plan->count[FSN_SEC_SM]; sm++) {
        image->sm_base[sm] = FSN_NONE;
    }
    for (uint32_t sub = 0; sub < plan->count[FSN_SEC_SUBDEVICE]; sub++) {
        if (!append_subdevice(plan, sub, datagram_bytes, image)) {
            fsn_image_free(image);
            return FSN_E_BUS_IMAGE;
        }
    }
    for (uint32_t sm = 0; sm < plan->count[FSN_SEC_SM]; sm++) {
        image->expected[image->sm_datagram[sm]] += fsn_image_wkc(plan, image, sm);
    }
    return FSN_OK;
}

void fsn_image_free(struct fsn_image *image) {
    free(image->sm_base);
    free(image->sm_datagram);
    free(image->datagram_begin);
    free(image->expected);
    *image = (struct fsn_image){0};
}

struct fsn_bus_layout fsn_image_layout(const struct fsn_image *image, uint8_t *bytes) {
    return (struct fsn_bus_layout){.image = bytes,
                                   .image_bytes = image->bytes,
                                   .sm_base = image->sm_base,
                                   .datagram_begin = image->datagram_begin,
                                   .datagram_count = image->datagram_count};
}
