/* What Python uses of the C core. The compiler checks it against the headers of master_core;
 * `@struct NAME` is the whole struct as they define it. */
#define FSN_NONE ...
#define FSN_FAULT_NO_RECORD ...
#define FSN_E_ARG ...
#define FSN_E_STATE ...
#define FSN_E_CLOSED ...

typedef int... fsn_status;
const char *fsn_status_name(fsn_status status);
const char *fsn_status_text(fsn_status status);
const char *fsn_status_next_step(fsn_status status);
const char *fsn_section_name(uint32_t section);

struct fsn_fault {
    fsn_status status;
    uint32_t section;
    uint32_t copy_index;
    uint32_t byte;
    int sys_errno;
    const char *rule;
    char detail[...];
    ...;
};

struct fsn_plan;
struct fsn_subdevice_info {
    const char *name;
    uint32_t first_sm, sm_count;
    ...;
};
struct fsn_sm_info {
    uint32_t subdevice, size_bytes;
    uint8_t index, direction, registered;
    ...;
};
struct fsn_symbol_info {
    const char *name;
    uint16_t bits;
    uint8_t output;
    ...;
};
struct fsn_connection_info {
    const char *name;
    ...;
};

fsn_status fsn_plan_load(const void *bytes, size_t len_bytes, struct fsn_plan **plan,
                         struct fsn_fault *fault);
void fsn_plan_free(struct fsn_plan *plan);
struct fsn_fingerprint {
    uint8_t whole[32];
    uint8_t section[6][32];
};
fsn_status fsn_plan_fingerprint(const struct fsn_plan *plan, struct fsn_fingerprint *fingerprint);
const char *fsn_fingerprint_section(uint32_t section);
uint32_t fsn_plan_cycle_ns(const struct fsn_plan *plan);
uint32_t fsn_plan_subdevice_count(const struct fsn_plan *plan);
uint32_t fsn_plan_bus_count(const struct fsn_plan *plan);
fsn_status fsn_plan_part(const struct fsn_plan *plan, uint32_t bus, struct fsn_plan **part);
uint32_t fsn_plan_sm_count(const struct fsn_plan *plan);
uint32_t fsn_plan_symbol_count(const struct fsn_plan *plan);
uint32_t fsn_plan_connection_count(const struct fsn_plan *plan);
fsn_status fsn_plan_subdevice(const struct fsn_plan *plan, uint32_t number,
                              struct fsn_subdevice_info *info);
fsn_status fsn_plan_sm(const struct fsn_plan *plan, uint32_t number, struct fsn_sm_info *info);
fsn_status fsn_plan_symbol(const struct fsn_plan *plan, uint32_t number,
                           struct fsn_symbol_info *info);
fsn_status fsn_plan_connection(const struct fsn_plan *plan, uint32_t number,
                               struct fsn_connection_info *info);

struct fsn_bus_ops {
    ...;
};
struct fsn_emulated;
const struct fsn_bus_ops *fsn_emulated_ops(void);
fsn_status fsn_emulated_create(const struct fsn_plan *plan, struct fsn_emulated **bus);
void fsn_emulated_free(struct fsn_emulated *bus);
fsn_status fsn_emulated_read_outputs(struct fsn_emulated *bus, uint32_t sm, uint8_t *buffer,
                                     size_t len_bytes, bool *fresh);
fsn_status fsn_emulated_write_inputs(struct fsn_emulated *bus, uint32_t sm, const uint8_t *buffer,
                                     size_t len_bytes);
fsn_status fsn_emulated_set_present(struct fsn_emulated *bus, uint32_t subdevice, bool present);

struct fsn_core;
@struct fsn_frame_counts
@struct fsn_histogram
@struct fsn_statistics
uint64_t fsn_histogram_floor(uint32_t bucket);
uint64_t fsn_histogram_percentile(const struct fsn_histogram *histogram, uint32_t per_million);
@struct fsn_direction
@struct fsn_parameters
struct fsn_connection_status {
    struct fsn_direction direction[2];
    struct fsn_parameters parameters;
    uint32_t differs, observed, gaps;
    ...;
};

struct fsn_followed {
    uint16_t sequence;
    ...;
};
struct fsn_monitor {
    struct fsn_connection_status status;
    struct fsn_followed followed[2];
    ...;
};
bool fsn_fsoe_check(const uint8_t *frame, size_t len_bytes, uint16_t old_crc, uint16_t sequence);
uint16_t fsn_fsoe_solve_sequence(const uint8_t *frame, size_t len_bytes, uint16_t old_crc);
fsn_status fsn_monitor_init(struct fsn_monitor *monitor, uint32_t to_sub_bytes,
                            uint32_t to_main_bytes);
int fsn_monitor_frame(struct fsn_monitor *monitor, int way, const uint8_t *frame, uint64_t now_ns);

struct fsn_event {
    uint64_t now_ns;
    uint32_t connection;
    uint8_t before, after, reset_code, by, differs;
    struct fsn_parameters parameters;
    ...;
};
struct fsn_thread_options {
    uint64_t cycle_ns;
    int priority;
    int cpu;
    bool lock_memory;
    ...;
};

fsn_status fsn_core_create(const struct fsn_plan *plan, const struct fsn_bus_ops *ops, void *bus,
                           struct fsn_core **core, struct fsn_fault *fault);
void fsn_core_free(struct fsn_core *core);
fsn_status fsn_core_cycle(struct fsn_core *core, uint64_t now_ns);
fsn_status fsn_core_start(struct fsn_core *core, const struct fsn_thread_options *options,
                          struct fsn_fault *fault);
void fsn_core_stop(struct fsn_core *core);
fsn_status fsn_core_snapshot(struct fsn_core *core, struct fsn_statistics *statistics,
                             struct fsn_connection_status *connections, uint8_t *image);
uint32_t fsn_core_image_bytes(const struct fsn_core *core);
uint64_t fsn_core_stale_cycles(const struct fsn_core *core, uint32_t sm);
uint32_t fsn_core_sm_base(const struct fsn_core *core, uint32_t sm);
bool fsn_core_event(struct fsn_core *core, struct fsn_event *event);
fsn_status fsn_core_set_output(struct fsn_core *core, uint32_t symbol, uint64_t value);
fsn_status fsn_core_read_symbol(const struct fsn_core *core, const uint8_t *image, uint32_t symbol,
                                uint64_t *value);

struct fsn_scan;
struct fsn_scan_place {
    uint32_t address;
    uint8_t command, way;
    uint16_t size_bytes;
    ...;
};
struct fsn_scan_connection {
    struct fsn_connection_status status;
    struct fsn_scan_place places[...];
    uint32_t place_count;
    uint16_t connection_id;
    uint8_t roles;
    ...;
};
struct fsn_sighting {
    uint64_t time_ns, packet;
    uint32_t connection;
    uint16_t sequence, size_bytes;
    uint8_t way, verdict, observed;
    uint8_t frame[...];
    ...;
};
struct fsn_scan_counts {
    uint64_t packets, ethercat, malformed, datagrams, unanswered, dropped;
    ...;
};
fsn_status fsn_scan_create(struct fsn_scan **scan);
void fsn_scan_free(struct fsn_scan *scan);
uint32_t fsn_scan_packet(struct fsn_scan *scan, uint32_t bus, const uint8_t *bytes,
                         size_t len_bytes, uint64_t time_ns);
bool fsn_scan_next(struct fsn_scan *scan, struct fsn_sighting *sighting);
uint32_t fsn_scan_connection_count(const struct fsn_scan *scan);
fsn_status fsn_scan_connection(const struct fsn_scan *scan, uint32_t number,
                               struct fsn_scan_connection *connection);
void fsn_scan_counts(const struct fsn_scan *scan, struct fsn_scan_counts *counts);

struct fsn_segment;
struct fsn_segment_counts {
    uint64_t frames, datagrams, lost, foreign, unsent, work_ns;
    int send_errno;
    ...;
};
fsn_status fsn_segment_create(struct fsn_plan *plan, struct fsn_segment **segment);
void fsn_segment_free(struct fsn_segment *segment);
size_t fsn_segment_frame(struct fsn_segment *segment, uint8_t *frame, size_t len_bytes,
                         uint64_t now_ns);
void fsn_segment_set_ring(struct fsn_segment *segment, bool ring);
size_t fsn_segment_frame_from(struct fsn_segment *segment, uint32_t port, uint8_t *frame,
                              size_t len_bytes, uint64_t now_ns, uint32_t *out_port);
void fsn_segment_idle(struct fsn_segment *segment, uint64_t now_ns);
uint32_t fsn_segment_size(const struct fsn_segment *segment);
uint32_t fsn_segment_position(const struct fsn_segment *segment, uint32_t subdevice);
fsn_status fsn_segment_read_outputs(struct fsn_segment *segment, uint32_t sm, uint8_t *buffer,
                                    size_t len_bytes, bool *fresh);
fsn_status fsn_segment_write_inputs(struct fsn_segment *segment, uint32_t sm, const uint8_t *buffer,
                                    size_t len_bytes);
uint8_t fsn_segment_al_status(struct fsn_segment *segment, uint32_t position, uint16_t *code);
void fsn_segment_set_present(struct fsn_segment *segment, uint32_t position, bool present);
void fsn_segment_power_cycle(struct fsn_segment *segment, uint32_t position);
fsn_status fsn_segment_set_link(struct fsn_segment *segment, uint32_t position, bool up);
fsn_status fsn_segment_rx_errors(struct fsn_segment *segment, uint32_t position, uint32_t port,
                                 uint32_t errors);
fsn_status fsn_segment_swap(struct fsn_segment *segment, uint32_t one, uint32_t other);
struct fsn_segment_identity {
    uint32_t vendor_id, product_code, revision;
    ...;
};
fsn_status fsn_segment_set_identity(struct fsn_segment *segment, uint32_t position,
                                    const struct fsn_segment_identity *identity);
fsn_status fsn_segment_set_sdo_abort(struct fsn_segment *segment, uint32_t position, uint16_t index,
                                     uint32_t sub, uint32_t code);
fsn_status fsn_segment_offer_object(struct fsn_segment *segment, uint32_t position, uint16_t index,
                                    uint8_t sub, const void *bytes, size_t len_bytes);
fsn_status fsn_segment_get_object(struct fsn_segment *segment, uint32_t position, uint16_t index,
                                  uint8_t sub, void *bytes, size_t len_bytes);
fsn_status fsn_segment_set_object(struct fsn_segment *segment, uint32_t position, uint16_t index,
                                  uint8_t sub, const void *bytes, size_t len_bytes);
fsn_status fsn_segment_set_clock_bits(struct fsn_segment *segment, uint32_t position,
                                      uint32_t bits);
fsn_status fsn_segment_set_mailbox_delay(struct fsn_segment *segment, uint32_t position,
                                         uint64_t delay_ns);
fsn_status fsn_segment_set_al_delay(struct fsn_segment *segment, uint32_t position,
                                    uint64_t delay_ns);
void fsn_segment_lose_every(struct fsn_segment *segment, uint32_t frames);
void fsn_segment_set_delay(struct fsn_segment *segment, uint64_t delay_ns);
void fsn_segment_stall(struct fsn_segment *segment, uint64_t duration_ns);
void fsn_segment_repeat(struct fsn_segment *segment, uint32_t frames);
void fsn_segment_lose(struct fsn_segment *segment, uint32_t frames);
void fsn_segment_counts(struct fsn_segment *segment, struct fsn_segment_counts *counts);
struct fsn_segment_link_options {
    const char *interface;
    const char *interface2;
    int priority;
    int cpu;
    bool no_machine_on_this_wire;
    ...;
};
bool fsn_segment_test_rig(void);
fsn_status fsn_segment_link(struct fsn_segment *segment,
                            const struct fsn_segment_link_options *options, int *sys_errno);
void fsn_segment_unlink(struct fsn_segment *segment);

#define FSN_E_BUSY ...
struct fsn_realtime;
@struct fsn_realtime_options
@struct fsn_realtime_fault
@struct fsn_realtime_symbol
@struct fsn_realtime_cycle
@struct fsn_realtime_counts
fsn_status fsn_realtime_open(const struct fsn_realtime_options *options,
                             struct fsn_realtime **realtime, struct fsn_realtime_fault *fault);
void fsn_realtime_close(struct fsn_realtime *realtime);
uint32_t fsn_realtime_symbol_count(const struct fsn_realtime *realtime);
fsn_status fsn_realtime_symbol(const struct fsn_realtime *realtime, uint32_t symbol,
                               struct fsn_realtime_symbol *info);
fsn_status fsn_realtime_wait(struct fsn_realtime *realtime, uint64_t timeout_ns,
                             struct fsn_realtime_cycle *cycle);
uint64_t fsn_realtime_get(const struct fsn_realtime *realtime, int32_t symbol);
double fsn_realtime_value(const struct fsn_realtime *realtime, int32_t symbol);
fsn_status fsn_realtime_set(struct fsn_realtime *realtime, int32_t symbol, uint64_t raw);
fsn_status fsn_realtime_set_value(struct fsn_realtime *realtime, int32_t symbol, double value);
void fsn_realtime_send(struct fsn_realtime *realtime);
struct fsn_realtime_counts fsn_realtime_counts(const struct fsn_realtime *realtime);
const uint8_t *fsn_realtime_image(const struct fsn_realtime *realtime);
uint32_t fsn_realtime_image_bytes(const struct fsn_realtime *realtime);
uint64_t fsn_realtime_cycle_ns(const struct fsn_realtime *realtime);

@struct fsn_axis_config
@struct fsn_axis_inputs
@struct fsn_axis_outputs
@struct fsn_axis_own
@struct fsn_axis
@struct fsn_axis_options
@struct fsn_axis_symbols
@struct fsn_realtime_axis
fsn_status fsn_axis_init(struct fsn_axis *axis, const struct fsn_axis_config *config);
void fsn_axis_step(struct fsn_axis *axis, const struct fsn_axis_inputs *inputs);
fsn_status fsn_axis_enable(struct fsn_axis *axis);
void fsn_axis_disable(struct fsn_axis *axis);
void fsn_axis_quick_stop(struct fsn_axis *axis);
fsn_status fsn_axis_reset(struct fsn_axis *axis);
void fsn_axis_halt(struct fsn_axis *axis, bool halts);
fsn_status fsn_axis_set_mode(struct fsn_axis *axis, int8_t mode);
fsn_status fsn_axis_set_position(struct fsn_axis *axis, int32_t position);
fsn_status fsn_axis_set_velocity(struct fsn_axis *axis, int32_t velocity);
fsn_status fsn_axis_set_torque(struct fsn_axis *axis, int16_t torque);
fsn_status fsn_axis_move(struct fsn_axis *axis, int32_t position, bool at_once);
fsn_status fsn_axis_home(struct fsn_axis *axis);
const char *fsn_axis_state_name(uint32_t state);
const char *fsn_axis_phase_name(uint32_t phase);
fsn_status fsn_realtime_axis_open(const struct fsn_realtime *realtime,
                                  const struct fsn_axis_options *options,
                                  struct fsn_realtime_axis *axis, struct fsn_realtime_fault *fault);
void fsn_realtime_axis_step(struct fsn_realtime_axis *axis, struct fsn_realtime *realtime,
                            const struct fsn_realtime_cycle *cycle);
