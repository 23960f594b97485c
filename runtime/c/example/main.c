/* A controller in C: loads the parameters from flash, ticks, and uses pose and status.
 *
 * Build (from the top of the project, after building the library):
 *   arm-none-eabi-gcc -mcpu=cortex-m4 -mthumb -mfloat-abi=hard -mfpu=fpv4-sp-d16 -O2 \
 *     -nostartfiles --specs=nano.specs --specs=rdimon.specs -L. -Truntime/c/example/program.ld \
 *     -Wl,--gc-sections -Iruntime/c runtime/c/example/main.c runtime/c/example/startup.c \
 *     target-arm/thumbv7em-none-eabihf/release/libhall_runtime.a -o controller
 *
 * Exit status: 0, or the HallResult with which the parameters were refused. */
#include "hall_runtime.h"
#include <stdio.h>

/* memory.x gives these; their addresses are the values. */
extern const uint8_t _parameter_slot_0[], _parameter_slot_bytes[];

static HallDecoder decoder;
static HallServo servo;
static HallPredictor predictor;

/* Stands for the converters: the third period has no code of probe A, the sixth no frame. */
static bool read_frame(uint32_t period, HallFrame *frame)
{
    *frame = (HallFrame){ { 1200 + 10 * (int32_t)period, 900, 700 }, { 300, -200, 100 },
                          period, 2000 * period,
                          { HALL_MISSING_CODE, HALL_MISSING_CODE } };
    if (period == 3)
        frame->hall[0] = HALL_MISSING_CODE;
    return period != 6;
}

int main(void)
{
    if (hall_version() != HALL_RUNTIME_VERSION) {
        printf("the header belongs to another library\n");
        return 97;
    }
    if (!hall_arithmetic_is_sound()) {
        printf("the FPU is not set as after reset\n");
        return 98;
    }
    HallResult loaded = hall_load(_parameter_slot_0, (size_t)_parameter_slot_bytes, NULL, &decoder);
    if (loaded != HALL_RESULT_OK) {
        printf("parameters refused: %u\n", (unsigned)loaded);
        return (int)loaded;
    }
    HallResult started = hall_servo_start(&servo, &decoder, 2);
    if (started != HALL_RESULT_OK)
        return (int)started;
    HallResult begun = hall_predictor_start(&predictor, 4000);
    if (begun != HALL_RESULT_OK)
        return (int)begun;
    for (uint32_t period = 0; period < 10; period++) {
        HallFrame frame;
        HallReading reading;
        if (read_frame(period, &frame)) {
            hall_tick(&servo, &frame, &reading);
            hall_predictor_take(&predictor, &servo, &frame, &reading);
        } else {
            hall_tick_without_frame(&servo, &reading);
        }
        /* Where the stage is when the forces change, 300 us after the sample, if that is known. */
        HallPlanarPose now;
        if (hall_predict(&predictor, frame.time_us + 300, &now)) {
            reading.x_m = now.x_m;
            reading.y_m = now.y_m;
            reading.rz_rad = now.rz_rad;
        }
        /* A controller moves on only what was measured, or held for a moment. */
        bool usable = !(reading.status & HALL_STATUS_PLANAR_INVALID)
                      || (reading.status & HALL_STATUS_PLANAR_HELD);
        printf("%u: x %d nm, y %d nm, rz %d nrad, status %u%s\n", (unsigned)period,
               (int)(reading.x_m * 1e9f), (int)(reading.y_m * 1e9f), (int)(reading.rz_rad * 1e9f),
               (unsigned)reading.status, usable ? "" : ": not usable");
    }
    HallHealth health = hall_health(&servo);
    printf("ticks %u, planar invalid %u, held %u, frames missed %u\n", (unsigned)health.ticks,
           (unsigned)health.planar_invalid, (unsigned)health.held, (unsigned)health.frames_missed);
    return 0;
}
