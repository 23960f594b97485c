/* Unit tests of a program that uses the C interface, on a computer: unit_test params.bin. Exit status: 0, or the line
 * of the first check that failed. */
#include "hall_runtime.h"
#include <stdio.h>
#include <string.h>

#define CHECK(condition) do { if (!(condition)) return __LINE__; } while (0)

static HallDecoder decoder;
static HallServo servo;

/* CRC-32C of the blob, lowest byte first. */
static void seal(uint8_t *blob, size_t length)
{
    uint32_t crc = 0xffffffff;
    for (size_t k = 0; k < length - 4; k++) {
        crc ^= blob[k];
        for (int bit = 0; bit < 8; bit++)
            crc = crc >> 1 ^ (crc & 1 ? 0x82f63b78 : 0);
    }
    crc = ~crc;
    for (int k = 0; k < 4; k++)
        blob[length - 4 + k] = (uint8_t)(crc >> 8 * k);
}

int main(int argc, char **argv)
{
    const HallFrame frame = { { 1200, 900, 700 }, { 300, -200, 100 }, 1, 2000,
                              { HALL_MISSING_CODE, HALL_MISSING_CODE } };
    HallReading reading, forced;
    uint8_t blob[1024];
    FILE *file = argc > 1 ? fopen(argv[1], "rb") : NULL;
    CHECK(file);
    size_t length = fread(blob, 1, sizeof blob, file);
    fclose(file);

    /* Header and library belong together. */
    CHECK(hall_version() == HALL_RUNTIME_VERSION && hall_version() >> 24 == HALL_LAYOUT_VERSION);
    CHECK(sizeof decoder == 512 && sizeof servo == 240 && sizeof frame == 40 && sizeof reading == 28);
    CHECK(hall_arithmetic_is_sound());

    CHECK(hall_load(blob, length, "HS-0007", &decoder) == HALL_RESULT_OK);
    CHECK(hall_servo_start(&servo, &decoder, 2) == HALL_RESULT_OK);
    CHECK(hall_tick(&servo, &frame, &reading) == HALL_RESULT_OK);
    CHECK(reading.status == 0 && reading.x_m != 0);

    /* The same parameters, written by `host-fit fit --force`. */
    blob[6] = 1;
    CHECK(hall_load(blob, length, NULL, &decoder) == HALL_RESULT_BAD_CRC);
    seal(blob, length);
    CHECK(hall_load(blob, length, NULL, &decoder) == HALL_RESULT_OK);
    CHECK(hall_servo_start(&servo, &decoder, 2) == HALL_RESULT_OK);
    CHECK(hall_tick(&servo, &frame, &forced) == HALL_RESULT_OK);
    CHECK(forced.status == HALL_STATUS_FORCED);
    forced.status = 0;
    CHECK(memcmp(&reading, &forced, sizeof reading) == 0);
    return 0;
}
