/* The same kernel and the same tick in C, as a programmer would write them, to be counted
 * beside the Rust ones. The structs mirror those of the runtime. */
#include <math.h>
#include <stdbool.h>
#include <stdint.h>

typedef struct { float eta, per_z, per_rx, per_ry; } sensitivity;
typedef struct { int32_t low, high; } window;
typedef struct { float x, y, rz; } planar;
typedef struct { float z, rx, ry; } vertical;
typedef struct {
    float vertical_per_code[3][3], planar_per_code[3][3];
    float calibrated_vertical[3], calibrated_planar[3];
    float sensitivity_min;
    window hall, capacitive;
    float gain_per_mk[3][2];
    int32_t temperature_zero_mc[2];
    uint32_t temperature_reach_mk[2];
    sensitivity probe[3];
} decoder;
typedef struct { float planar_per_code[3][3]; sensitivity probe[3]; } kernel;
typedef struct { int32_t hall[3], capacitive[3]; uint32_t sequence, time_us; int32_t temperature_mc[2]; } frame;
typedef struct { planar planar; vertical vertical; uint32_t status; } reading;

static inline float dot(const float *row, const float *v)
{
    return row[0] * v[0] + row[1] * v[1] + row[2] * v[2];
}

static inline float phi_of(const sensitivity *s, const vertical *v)
{
    return s->eta + s->per_z * v->z + s->per_rx * v->rx + s->per_ry * v->ry;
}

static inline void pose_of(const float (*rows)[3], const float *signal, const float *phi,
                           const planar *zero, planar *pose)
{
    const float ratio[3] = { signal[0] / phi[0], signal[1] / phi[1], signal[2] / phi[2] };
    pose->x = dot(rows[0], ratio) - zero->x;
    pose->y = dot(rows[1], ratio) - zero->y;
    pose->rz = dot(rows[2], ratio) - zero->rz;
}

void counted_c_kernel(const kernel *c, const float *signal, const vertical *v,
                  const planar *zero, planar *pose)
{
    const float phi[3] = { phi_of(&c->probe[0], v), phi_of(&c->probe[1], v), phi_of(&c->probe[2], v) };
    pose_of(c->planar_per_code, signal, phi, zero, pose);
}

static inline bool outside(const window *w, int32_t code) { return code < w->low || code > w->high; }

void counted_c_tick(const decoder *c, const frame *f, const planar *zero, reading *out)
{
    uint32_t status = 0;
    float gap[3], hall[3], phi[3];
    for (int k = 0; k < 3; k++) {
        gap[k] = (float)f->capacitive[k];
        hall[k] = (float)f->hall[k];
        status |= (uint32_t)outside(&c->hall, f->hall[k]) << k;
        status |= (uint32_t)outside(&c->capacitive, f->capacitive[k]) << (3 + k);
    }
    vertical v = { dot(c->vertical_per_code[0], gap), dot(c->vertical_per_code[1], gap),
                   dot(c->vertical_per_code[2], gap) };
    if (!isfinite(v.z) || !isfinite(v.rx) || !isfinite(v.ry)) status |= 1u << 10;
    if (fabsf(v.z) > c->calibrated_vertical[0] || fabsf(v.rx) > c->calibrated_vertical[1]
        || fabsf(v.ry) > c->calibrated_vertical[2]) status |= 1u << 11;
    for (int k = 0; k < 3; k++) {
        phi[k] = phi_of(&c->probe[k], &v);
        if (!(fabsf(phi[k]) >= c->sensitivity_min) || !isfinite(phi[k])) status |= 1u << (6 + k);
    }
    planar q;
    pose_of(c->planar_per_code, hall, phi, zero, &q);
    if (!isfinite(q.x) || !isfinite(q.y) || !isfinite(q.rz)) status |= 1u << 9;
    if (fabsf(q.x) > c->calibrated_planar[0] || fabsf(q.y) > c->calibrated_planar[1]
        || fabsf(q.rz) > c->calibrated_planar[2]) status |= 1u << 12;
    if (status & 0x438u) { status |= 1u << 14; v = (vertical){ 0, 0, 0 }; }
    if (status & 0x7ffu) { status |= 1u << 13; q = (planar){ 0, 0, 0 }; }
    out->planar = q;
    out->vertical = v;
    out->status = status;
}
