// Reads the pose of a 6-DOF stage from its Hall and capacitive codes, in C.
// Link libhall_runtime.a with --gc-sections. See runtime/c/example/main.c for a whole program.

#ifndef HALL_RUNTIME_H
#define HALL_RUNTIME_H

// Made by cbindgen from runtime/c/src: change it there.

#include <stdarg.h>
#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>
#include <stdlib.h>

// On what must not be ignored, where the compiler knows how to say it.
#if (defined(__cplusplus) && __cplusplus >= 201703L) \
  || (defined(__STDC_VERSION__) && __STDC_VERSION__ >= 202311L)
#define HALL_NODISCARD [[nodiscard]]
#elif defined(__GNUC__)
#define HALL_NODISCARD __attribute__((warn_unused_result))
#else
#define HALL_NODISCARD
#endif

// Words of 64 bits of a decoder.
#define HALL_DECODER_WORDS 63

// Of a servo.
#define HALL_SERVO_WORDS 29

// Of a predictor.
#define HALL_PREDICTOR_WORDS 19

// Major version of the library that this header belongs to.
#define HALL_RUNTIME_VERSION_MAJOR 0

// Minor version.
#define HALL_RUNTIME_VERSION_MINOR 2

// Patch version.
#define HALL_RUNTIME_VERSION_PATCH 0

// Version of the sizes and fields of the structs in this header.
#define HALL_LAYOUT_VERSION 1

// The version as one number that can be compared: layout << 24, major << 16, minor << 8, patch.
#define HALL_RUNTIME_VERSION ((((HALL_LAYOUT_VERSION << 24) | (HALL_RUNTIME_VERSION_MAJOR << 16)) | (HALL_RUNTIME_VERSION_MINOR << 8)) | HALL_RUNTIME_VERSION_PATCH)

// Hall code A is at a rail, implausible or missing.
#define HALL_STATUS_HALL_A (1 << 0)

// Hall code B likewise.
#define HALL_STATUS_HALL_B (1 << 1)

// Hall code C likewise.
#define HALL_STATUS_HALL_C (1 << 2)

// Capacitive code 1 is at a rail, implausible or missing.
#define HALL_STATUS_CAPACITIVE_1 (1 << 3)

// Capacitive code 2 likewise.
#define HALL_STATUS_CAPACITIVE_2 (1 << 4)

// Capacitive code 3 likewise.
#define HALL_STATUS_CAPACITIVE_3 (1 << 5)

// The sensitivity of probe A is too near zero, or not finite.
#define HALL_STATUS_SENSITIVITY_A (1 << 6)

// That of probe B likewise.
#define HALL_STATUS_SENSITIVITY_B (1 << 7)

// That of probe C likewise.
#define HALL_STATUS_SENSITIVITY_C (1 << 8)

// A planar result is not finite.
#define HALL_STATUS_PLANAR_NOT_FINITE (1 << 9)

// A vertical result is not finite.
#define HALL_STATUS_VERTICAL_NOT_FINITE (1 << 10)

// Z, Rx or Ry lies outside the calibrated range.
#define HALL_STATUS_VERTICAL_EXTRAPOLATED (1 << 11)

// X, Y or Rz lies outside the calibrated range.
#define HALL_STATUS_PLANAR_EXTRAPOLATED (1 << 12)

// X, Y, Rz are invalid.
#define HALL_STATUS_PLANAR_INVALID (1 << 13)

// Z, Rx, Ry are invalid.
#define HALL_STATUS_VERTICAL_INVALID (1 << 14)

// A temperature is missing or implausible: decoded as if at T0 of the calibration.
#define HALL_STATUS_TEMPERATURE_MISSING (1 << 15)

// The parameters were written by `host-fit fit --force`: their log was refused.
#define HALL_STATUS_FORCED (1 << 16)

// One or more servo periods before this frame had no frame.
#define HALL_STATUS_FRAMES_MISSED (1 << 17)

// The frame repeats an earlier sequence number.
#define HALL_STATUS_FRAME_REPEATED (1 << 18)

// A zero deviation is subtracted from X, Y, Rz. No fault.
#define HALL_STATUS_ZERO_SET (1 << 19)

// X, Y, Rz are the last valid ones, repeated.
#define HALL_STATUS_PLANAR_HELD (1 << 20)

// Z, Rx, Ry are the last valid ones, repeated.
#define HALL_STATUS_VERTICAL_HELD (1 << 21)

// In place of a code that could not be read. No converter gives it, and it lies below
// every window of accepted codes, so a missing code is never decoded.
#define HALL_MISSING_CODE INT32_MIN

// What became of a call. 32 bits wide, whatever a compiler makes of enums.
enum HallResult
#if defined(__cplusplus) || __STDC_VERSION__ >= 202311L
  : uint32_t
#endif // defined(__cplusplus) || __STDC_VERSION__ >= 202311L
 {
  // Done.
  HALL_RESULT_OK = 0,
  // A pointer that is needed is NULL.
  HALL_RESULT_NULL_POINTER = 1,
  // The memory is shorter than a blob, or than the blob's header says.
  HALL_RESULT_TRUNCATED = 2,
  // The memory is erased: no blob was written.
  HALL_RESULT_ERASED = 3,
  // Something else than a blob.
  HALL_RESULT_BAD_MAGIC = 4,
  // A layout that this version does not read.
  HALL_RESULT_UNKNOWN_VERSION = 5,
  // A length that no blob has.
  HALL_RESULT_BAD_HEADER = 6,
  // A bit is wrong.
  HALL_RESULT_BAD_CRC = 7,
  // The check holds, yet the payload is not a parameter set.
  HALL_RESULT_BAD_PAYLOAD = 8,
  // A parameter is NaN or infinite, a matrix singular, or the like.
  HALL_RESULT_UNUSABLE_PARAMETERS = 9,
  // The blob belongs to another stage than expected.
  HALL_RESULT_OTHER_STAGE = 10,
  // The decoder was never loaded.
  HALL_RESULT_NOT_LOADED = 11,
  // The servo or the predictor was never started.
  HALL_RESULT_NOT_STARTED = 12,
};
#ifndef __cplusplus
#if __STDC_VERSION__ >= 202311L
typedef enum HallResult HallResult;
#else
typedef uint32_t HallResult;
#endif // __STDC_VERSION__ >= 202311L
#endif // __cplusplus

// Where a re-zero stands.
enum HallRezero
#if defined(__cplusplus) || __STDC_VERSION__ >= 202311L
  : uint32_t
#endif // defined(__cplusplus) || __STDC_VERSION__ >= 202311L
 {
  // No re-zero was asked for.
  HALL_REZERO_IDLE = 0,
  // It runs.
  HALL_REZERO_RUNNING = 1,
  // It ended, and the zero deviation is in use.
  HALL_REZERO_DONE = 2,
  // Refused: fewer than 250 ticks were asked for.
  HALL_REZERO_TOO_SHORT = 3,
  // Refused: a tick gave no planar pose.
  HALL_REZERO_NO_POSE = 4,
  // Refused: the stage moved.
  HALL_REZERO_MOVED = 5,
  // Refused: the pose drifted.
  HALL_REZERO_DRIFTED = 6,
  // Refused: the stage stands too far from its zero, or is lifted or tilted.
  HALL_REZERO_OUT_OF_BOUNDS = 7,
  // Refused: a pose lies outside the calibrated range.
  HALL_REZERO_EXTRAPOLATED = 8,
};
#ifndef __cplusplus
#if __STDC_VERSION__ >= 202311L
typedef enum HallRezero HallRezero;
#else
typedef uint32_t HallRezero;
#endif // __STDC_VERSION__ >= 202311L
#endif // __cplusplus

// A decoder, as C sees it. Its contents are private.
typedef struct {
  uint64_t mark;
  uint64_t opaque[HALL_DECODER_WORDS];
} HallDecoder;

// A servo, as C sees it. Its contents are private.
typedef struct {
  uint64_t mark;
  uint64_t opaque[HALL_SERVO_WORDS];
} HallServo;

// The codes of one servo period. Time and sequence arrive as data: the runtime reads
// no clock.
typedef struct {
  // Hall codes of the probes A, B, C.
  int32_t hall[3];
  // Capacitive codes of the gaps 1, 2, 3.
  int32_t capacitive[3];
  // Number of the servo period, wrapping.
  uint32_t sequence;
  // When the codes were sampled, in us, wrapping (after 71 minutes).
  uint32_t time_us;
  // Temperature of the magnets' mount and of the stage body at the Hall elements, in m degC,
  // held from the last measurement; a missing code where there is none.
  int32_t temperature_mc[2];
} HallFrame;

// A pose and what is wrong with it: all is good when the status is 0, or HALL_STATUS_ZERO_SET
// alone. Invalid fields are 0 unless held.
typedef struct {
  // Displacement along X, m.
  float x_m;
  // Displacement along Y, m.
  float y_m;
  // Rotation about Z, rad.
  float rz_rad;
  // Displacement along Z, m.
  float z_m;
  // Rotation about X, rad.
  float rx_rad;
  // Rotation about Y, rad.
  float ry_rad;
  // The bits that HALL_STATUS_ names.
  uint32_t status;
} HallReading;

// Motion in the plane.
typedef struct {
  // Displacement along X, m.
  float x_m;
  // Displacement along Y, m.
  float y_m;
  // Rotation about Z, rad.
  float rz_rad;
} HallPlanarPose;

// Counters since start. They saturate: they never wrap to a good-looking zero.
typedef struct {
  // Ticks, with and without a frame.
  uint32_t ticks;
  // Ticks with an invalid planar pose.
  uint32_t planar_invalid;
  // Ticks with an invalid vertical pose.
  uint32_t vertical_invalid;
  // Ticks with a held value.
  uint32_t held;
  // Servo periods that had no frame.
  uint32_t frames_missed;
  // Frames that repeated an earlier sequence number.
  uint32_t frames_repeated;
} HallHealth;

// A predictor, as C sees it. Its contents are private.
typedef struct {
  uint64_t mark;
  uint64_t opaque[HALL_PREDICTOR_WORDS];
} HallPredictor;

// A and L of a stage: q' = q + A a + L v.
typedef struct {
  // A: rows X, Y, Rz in m, m, rad per m/s2 or rad/s2 of the acceleration of X, Y, Rz, Z, Rx, Ry.
  float acceleration_s2[3][6];
  // L: rows X, Y, Rz in m, m, rad per m/s or rad/s of the velocity of X, Y, Rz.
  float velocity_s[3][3];
} HallMotionCorrection;

// Commanded velocity and acceleration at the instant of a pose.
typedef struct {
  // Of X, Y, Rz: m/s, m/s, rad/s.
  float velocity[3];
  // Of X, Y, Rz, Z, Rx, Ry: m/s2, m/s2, rad/s2, m/s2, rad/s2, rad/s2.
  float acceleration[6];
} HallCommandedMotion;

#ifdef __cplusplus
extern "C" {
#endif // __cplusplus

// HALL_RUNTIME_VERSION of the library. A header of another layout has structs of other sizes: compare it with the
// header's once, before any other call.
HALL_NODISCARD
uint32_t hall_version(void);

// Whether floating-point arithmetic is set as after a reset, so that poses are, bit for bit,
// those that the host computed. Check it once, before the first tick.
HALL_NODISCARD bool hall_arithmetic_is_sound(void);

// Loads the parameter blob at the start of `memory` (flash, padding may follow), checks it,
// and makes a decoder of it. `serial` is the serial number of the stage that is expected, or
// NULL to take any stage. Unless the result is HALL_RESULT_OK, the decoder is unchanged.
//
// # Safety
// `memory` points to `length` readable bytes; `serial` is NULL or ends in a zero byte;
// `decoder` is NULL or points to a HallDecoder that no servo uses.
HALL_NODISCARD
HallResult hall_load(const uint8_t *memory,
                     size_t length,
                     const char *serial,
                     HallDecoder *decoder);

// Starts a servo: no zero deviation, nothing to hold, all counters zero. What is invalid is
// held for `hold_ticks` ticks in a row, and zero after that. Unless the result is
// HALL_RESULT_OK, the servo is unchanged.
//
// # Safety
// `decoder` is NULL, or memory that was zero before hall_load filled it or failed to; once it is
// filled, it is neither changed nor moved while the servo is used.
HALL_NODISCARD
HallResult hall_servo_start(HallServo *servo,
                            const HallDecoder *decoder,
                            uint16_t hold_ticks);

// One servo period: decodes the frame into `reading`. Unless the result is HALL_RESULT_OK, all
// six fields of the reading are 0 and marked invalid.
HallResult hall_tick(HallServo *servo, const HallFrame *frame, HallReading *reading);

// One servo period without a frame: values are held or zero. Unless the result is
// HALL_RESULT_OK, all six fields of the reading are 0 and marked invalid.
HallResult hall_tick_without_frame(HallServo *servo, HallReading *reading);

// Forgets the pose to hold and the sequence; zero deviation and counters stay.
HallResult hall_forget(HallServo *servo);

// Starts to average at rest, over `ticks` ticks (250 or more) with the default limits of
// movement and of the zero deviation; hall_rezero_state reports the progress.
HallResult hall_rezero_start(HallServo *servo, uint16_t ticks);

// Where the re-zero stands; idle for a null pointer or a servo that was never started.
HallRezero hall_rezero_state(const HallServo *servo);

// The zero deviation that is subtracted, as a pose; zeros for a null pointer or a servo that was
// never started.
HallPlanarPose hall_zero(const HallServo *servo);

// Subtracts a zero deviation that is known, for instance from before a restart. One that is
// not finite, a null pointer and a servo that was never started are ignored and `false` returned.
HALL_NODISCARD bool hall_set_zero(HallServo *servo, HallPlanarPose zero);

// The counters; zeros for a null pointer or a servo that was never started.
HallHealth hall_health(const HallServo *servo);

// Starts a predictor without poses. `age_max_us` is the largest age of a pose that is carried
// on, and the longest time between two poses in a row: one or two servo periods.
HALL_NODISCARD HallResult hall_predictor_start(HallPredictor *predictor, uint16_t age_max_us);

// Takes the reading that `servo` has just made of `frame`; an invalid one is passed over. Call
// it after each hall_tick.
HallResult hall_predictor_take(HallPredictor *predictor,
                               const HallServo *servo,
                               const HallFrame *frame,
                               const HallReading *reading);

// X, Y, Rz at a time of the frames' clock (us, wrapping), by the slope of the last eight valid
// poses. `false`, and zeros, before there are eight in a row, for a time before the last one or
// further after it than the largest age, and for a predictor that was never started.
HALL_NODISCARD
bool hall_predict(const HallPredictor *predictor,
                  uint32_t time_us,
                  HallPlanarPose *pose);

// Reads the motion correction of the parameter blob at the start of `memory`, which is checked as by
// hall_load; zeros where the blob has none. Unless the result is HALL_RESULT_OK, the correction is
// unchanged.
//
// # Safety
// `memory` points to `length` readable bytes; `correction` is NULL or points to memory for one.
HALL_NODISCARD
HallResult hall_load_motion_correction(const uint8_t *memory,
                                       size_t length,
                                       HallMotionCorrection *correction);

// The pose without the errors that follow the commanded motion. The trajectory generator gives
// velocity and acceleration, for the sample of the pose. `false`, and zeros, for a null pointer and
// where the pose or the command is NaN or infinite.
HALL_NODISCARD
bool hall_correct_motion(const HallMotionCorrection *correction,
                         HallPlanarPose pose,
                         const HallCommandedMotion *commanded,
                         HallPlanarPose *corrected);

#ifdef __cplusplus
}  // extern "C"
#endif  // __cplusplus

#endif  /* HALL_RUNTIME_H */
