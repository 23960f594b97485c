/* Does a job file through the C interface: only sections with a blob (see tests/src/job.rs).
 * Reads job.bin, writes words.bin. */
#include "hall_runtime.h"
#include <fcntl.h>
#include <stdio.h>
#include <string.h>
#include <unistd.h>

static HallDecoder decoder;
static HallServo servo;
static HallMotionCorrection correction;
static uint8_t blob[764];
static uint32_t frames[256][9];
static HallReading readings[256];

_Static_assert(sizeof(HallReading) == 28, "seven words");

static int all(ssize_t (*transfer)(int, void *, size_t), int file, void *bytes, size_t length)
{
    for (size_t done = 0; done < length;) {
        ssize_t now = transfer(file, (char *)bytes + done, length - done);
        if (now <= 0)
            return 0;
        done += (size_t)now;
    }
    return 1;
}

/* The motion of tests/src/job.rs. */
static float number(int32_t code, uint32_t sequence)
{
    union { uint32_t word; float number; } any = { .word = (uint32_t)code << 16 };
    return sequence % 64 == 0 ? any.number : (float)code * 1e-4f;
}

static void correct(HallReading *reading, const HallFrame *frame)
{
    HallCommandedMotion commanded;
    HallPlanarPose pose = { reading->x_m, reading->y_m, reading->rz_rad };
    for (int k = 0; k < 3; k++) {
        commanded.velocity[k] = number(frame->hall[k], frame->sequence);
        commanded.acceleration[k] = number(frame->capacitive[k], frame->sequence);
        commanded.acceleration[3 + k] = number(frame->hall[(k + 1) % 3], frame->sequence);
    }
    (void)!hall_correct_motion(&correction, pose, &commanded, &pose);
    reading->x_m = pose.x_m;
    reading->y_m = pose.y_m;
    reading->rz_rad = pose.rz_rad;
}

static ssize_t put(int file, void *bytes, size_t length) { return write(file, bytes, length); }

int main(void)
{
    int job = open("job.bin", O_RDONLY), words = open("words.bin", O_WRONLY | O_CREAT | O_TRUNC, 0644);
    uint32_t head[4];
    if (job < 0 || words < 0)
        return 2;
    while (all(read, job, head, sizeof head)) {
        size_t length = (head[3] + 3) / 4 * 4;
        if (head[0] != 2 || length > sizeof blob || !all(read, job, blob, length))
            return 3;
        if (hall_load(blob, length, NULL, &decoder) != HALL_RESULT_OK)
            return 4;
        if (hall_load_motion_correction(blob, length, &correction) != HALL_RESULT_OK)
            return 8;
        if (hall_servo_start(&servo, &decoder, (uint16_t)head[2]) != HALL_RESULT_OK)
            return 7;
        for (uint32_t left = head[1]; left > 0;) {
            uint32_t now = left < 256 ? left : 256;
            if (!all(read, job, frames, now * sizeof frames[0]))
                return 5;
            for (uint32_t k = 0; k < now; k++) {
                HallFrame frame = { .time_us = 0 };
                memcpy(&frame, frames[k], 7 * sizeof frames[k][0]);
                memcpy(frame.temperature_mc, &frames[k][7], sizeof frame.temperature_mc);
                hall_tick(&servo, &frame, &readings[k]);
                if (correction.acceleration_s2[0][0] != 0)
                    correct(&readings[k], &frame);
            }
            if (!all(put, words, readings, now * sizeof readings[0]))
                return 6;
            left -= now;
        }
    }
    return 0;
}
