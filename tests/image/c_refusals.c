/* What the C interface refuses: a decoder that was never loaded, a servo that was never started,
 * null pointers. Exit status: 0, or the line of the first check that failed. */
#include "hall_runtime.h"
#include <string.h>

extern const uint8_t _parameter_slot_0[], _parameter_slot_bytes[];

#define CHECK(condition) do { if (!(condition)) return __LINE__; } while (0)

static HallDecoder decoder, unloaded;
static HallServo servo, unstarted;

static const HallFrame frame = { { 120, 90, 70 }, { 300, -200, 100 }, 1, 2000, { 0, 0 } };

/* Whether a reading says that there is no pose, in all six fields. */
static bool invalid(const HallReading *reading)
{
    const HallReading nothing = {
        .status = HALL_STATUS_PLANAR_INVALID | HALL_STATUS_VERTICAL_INVALID
    };
    return memcmp(reading, &nothing, sizeof nothing) == 0;
}

/* The refusals of a servo that is not there or was never started. */
static int refuses(HallServo *none, HallResult expected)
{
    const HallPlanarPose zero = { 1e-6f, 0, 0 };
    HallReading reading;
    memset(&reading, 0x55, sizeof reading);
    CHECK(hall_tick(none, &frame, &reading) == expected && invalid(&reading));
    memset(&reading, 0x55, sizeof reading);
    CHECK(hall_tick_without_frame(none, &reading) == expected && invalid(&reading));
    CHECK(hall_forget(none) == expected);
    CHECK(hall_rezero_start(none, 500) == expected);
    CHECK(hall_rezero_state(none) == HALL_REZERO_IDLE);
    CHECK(!hall_set_zero(none, zero));
    CHECK(hall_zero(none).x_m == 0 && hall_health(none).ticks == 0);
    return 0;
}

/* A stage that moves along X. The first pose goes by: the zero deviation is new to the predictor. */
static int predicts(void)
{
    HallPredictor predictor;
    HallPlanarPose pose;
    HallReading reading = { 0 };
    memset(&predictor, 0xa5, sizeof predictor);
    CHECK(!hall_predict(&predictor, 0, &pose) && pose.x_m == 0);
    CHECK(hall_predictor_take(&predictor, &servo, &frame, &reading) == HALL_RESULT_NOT_STARTED);
    CHECK(hall_predictor_start(NULL, 4000) == HALL_RESULT_NULL_POINTER);
    CHECK(hall_predictor_start(&predictor, 4000) == HALL_RESULT_OK);
    hall_forget(&servo);
    for (uint32_t k = 0; k < 9; k++) {
        HallFrame moved = frame;
        moved.hall[2] += 160 * (int32_t)k;
        moved.sequence = k;
        moved.time_us = 2000 * k;
        CHECK(hall_tick(&servo, &moved, &reading) == HALL_RESULT_OK);
        CHECK(!hall_predict(&predictor, 2000 * k, &pose));
        CHECK(hall_predictor_take(&predictor, &servo, &moved, &reading) == HALL_RESULT_OK);
    }
    CHECK(hall_predict(&predictor, 16000, &pose) && pose.x_m == reading.x_m);
    const float at_the_sample = pose.x_m;
    CHECK(hall_predict(&predictor, 16300, &pose) && pose.x_m > at_the_sample);
    CHECK(!hall_predict(&predictor, 20001, &pose) && pose.x_m == 0);
    CHECK(!hall_predict(NULL, 16000, &pose) && !hall_predict(&predictor, 16000, NULL));
    return 0;
}

/* A pose that a commanded acceleration changes. */
static int corrects(void)
{
    const size_t length = (size_t)_parameter_slot_bytes;
    HallMotionCorrection correction = { { { 1 } }, { { 1 } } };
    HallCommandedMotion commanded = { { 0 }, { 0, 0, 0, 0, 0, 2 } };
    HallPlanarPose pose = { 1e-6f, 2e-6f, 3e-6f }, corrected;
    const HallPlanarPose none = { 0, 0, 0 };
    CHECK(hall_load_motion_correction(_parameter_slot_0, 100, &correction) == HALL_RESULT_TRUNCATED);
    CHECK(correction.acceleration_s2[0][0] == 1);
    CHECK(hall_load_motion_correction(NULL, length, &correction) == HALL_RESULT_NULL_POINTER);
    CHECK(hall_load_motion_correction(_parameter_slot_0, length, NULL) == HALL_RESULT_NULL_POINTER);
    /* This blob has no correction. */
    CHECK(hall_load_motion_correction(_parameter_slot_0, length, &correction) == HALL_RESULT_OK);
    CHECK(hall_correct_motion(&correction, pose, &commanded, &corrected));
    CHECK(memcmp(&pose, &corrected, sizeof pose) == 0);
    correction.acceleration_s2[2][5] = 1e-5f;
    CHECK(hall_correct_motion(&correction, pose, &commanded, &corrected));
    CHECK(corrected.rz_rad == 3e-6f + 1e-5f * 2 && corrected.x_m == pose.x_m);
    CHECK(!hall_correct_motion(NULL, pose, &commanded, &corrected));
    CHECK(!hall_correct_motion(&correction, pose, NULL, &corrected));
    CHECK(!hall_correct_motion(&correction, pose, &commanded, NULL));
    commanded.velocity[1] = __builtin_nanf("");
    CHECK(!hall_correct_motion(&correction, pose, &commanded, &corrected));
    CHECK(memcmp(&none, &corrected, sizeof none) == 0);
    return 0;
}

static int run(void)
{
    const size_t length = (size_t)_parameter_slot_bytes;
    HallReading first, again;
    int line;

    CHECK(hall_version() == HALL_RUNTIME_VERSION);
    /* Memory that was never filled: zeros, and what may lie on a stack. */
    CHECK(hall_servo_start(&servo, &unloaded, 2) == HALL_RESULT_NOT_LOADED);
    if ((line = refuses(&servo, HALL_RESULT_NOT_STARTED)) != 0)
        return line;
    memset(&unloaded, 0xa5, sizeof unloaded);
    memset(&unstarted, 0xa5, sizeof unstarted);
    CHECK(hall_servo_start(&servo, &unloaded, 2) == HALL_RESULT_NOT_LOADED);
    if ((line = refuses(&unstarted, HALL_RESULT_NOT_STARTED)) != 0)
        return line;
    if ((line = refuses(NULL, HALL_RESULT_NULL_POINTER)) != 0)
        return line;
    CHECK(hall_servo_start(NULL, &decoder, 2) == HALL_RESULT_NULL_POINTER);
    CHECK(hall_servo_start(&servo, NULL, 2) == HALL_RESULT_NULL_POINTER);
    CHECK(hall_load(NULL, length, NULL, &decoder) == HALL_RESULT_NULL_POINTER);
    CHECK(hall_load(_parameter_slot_0, length, NULL, NULL) == HALL_RESULT_NULL_POINTER);

    /* A refused blob leaves no decoder. */
    CHECK(hall_load(_parameter_slot_0, 100, NULL, &decoder) == HALL_RESULT_TRUNCATED);
    CHECK(hall_servo_start(&servo, &decoder, 2) == HALL_RESULT_NOT_LOADED);

    CHECK(hall_load(_parameter_slot_0, length, NULL, &decoder) == HALL_RESULT_OK);
    CHECK(hall_servo_start(&servo, &decoder, 2) == HALL_RESULT_OK);
    CHECK(hall_tick(&servo, &frame, &first) == HALL_RESULT_OK && first.status == 0);

    /* Another blob that is refused, and another decoder, change nothing. */
    CHECK(hall_load(_parameter_slot_0, 100, NULL, &decoder) == HALL_RESULT_TRUNCATED);
    CHECK(hall_load(_parameter_slot_0, length, "another", &decoder) == HALL_RESULT_OTHER_STAGE);
    CHECK(hall_servo_start(&servo, &unloaded, 2) == HALL_RESULT_NOT_LOADED);
    CHECK(hall_forget(&servo) == HALL_RESULT_OK);
    CHECK(hall_tick(&servo, &frame, &again) == HALL_RESULT_OK);
    CHECK(memcmp(&first, &again, sizeof first) == 0);

    /* A null frame or reading is no tick. */
    memset(&again, 0x55, sizeof again);
    CHECK(hall_tick(&servo, NULL, &again) == HALL_RESULT_NULL_POINTER && invalid(&again));
    CHECK(hall_tick(&servo, &frame, NULL) == HALL_RESULT_NULL_POINTER);
    CHECK(hall_tick_without_frame(&servo, NULL) == HALL_RESULT_NULL_POINTER);
    CHECK(hall_health(&servo).ticks == 2);

    /* The status shows a zero deviation; a run that is too short is refused. */
    CHECK(hall_set_zero(&servo, (HallPlanarPose){ 1e-6f, 0, 0 }));
    CHECK(hall_tick_without_frame(&servo, &again) == HALL_RESULT_OK);
    CHECK(again.status & HALL_STATUS_ZERO_SET);
    CHECK(hall_rezero_start(&servo, 249) == HALL_RESULT_OK);
    CHECK(hall_rezero_state(&servo) == HALL_REZERO_TOO_SHORT);
    return (line = predicts()) != 0 ? line : corrects();
}

int main(void)
{
    return run();
}
