/* The agent core over standard input and output, for tests and for a first look.

   One event per line in, as text; messages are hexadecimal, numbers of C or hexadecimal floats:

     robot ID RADIUS MAX_SPEED MAX_ACCEL SPEED_LIMIT BOOT PERIOD_NS
     command|plan|clock NOW_NS BYTES
     tick NOW_NS X Y HEADING              X is nan for a robot without a pose
     failed NOW_NS

   After every tick the messages that are sent, and then what the robot does:

     start X Y HEADING                    where a robot without a pose counts as standing
     hello|clock|report BYTES
     tick PHASE FAULT SPEED CURVATURE DISTANCE TURN PLACE EPOCH REVISION HOLDS LEAVES READING TIME

   TIME is the coordinator's time in nanoseconds as the robot knows it, or `-`.

   `size` prints the bytes of an agent. */

#include <inttypes.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "splinefleet.h"

static sf_agent agent;
static sf_robot robot;
static char id[64], line[16384];
static uint8_t received[8192], plan[8192], sent[SF_LONGEST_SENT];

static size_t bytes_of(const char *text, uint8_t *bytes) {
    size_t count = 0;
    unsigned byte;
    for (; count < sizeof received && sscanf(text, "%2x", &byte) == 1; text += 2) {
        bytes[count++] = (uint8_t)byte;
        if (text[1] == 0) break;
    }
    return count;
}

static void hear(int kind, char *rest) {
    int64_t now_ns = strtoll(rest, &rest, 10);
    size_t length;
    while (*rest == ' ') rest++;
    if (kind == SF_PLAN && sf_is_reading(&agent)) return;
    length = bytes_of(rest, kind == SF_PLAN ? plan : received);
    sf_hear(&agent, kind, kind == SF_PLAN ? plan : received, length, now_ns);
}

static void tick(char *rest) {
    static const char *const NAMES[] = {[SF_HELLO] = "hello", [SF_CLOCK] = "clock", [SF_REPORT] = "report"};
    int64_t now_ns = strtoll(rest, &rest, 10);
    int64_t time_ns;
    sf_real pose[3];
    size_t length;
    int kind;
    for (int i = 0; i < 3; i++) pose[i] = (sf_real)strtod(rest, &rest);
    if (pose[0] != pose[0] && sf_start_pose(&agent, &pose[0], &pose[1], &pose[2]))
        printf("start %a %a %a\n", (double)pose[0], (double)pose[1], (double)pose[2]);
    sf_tick(&agent, now_ns, pose[0], pose[1], pose[2]);
    while ((kind = sf_speak(&agent, now_ns, sent, &length)) != SF_NOTHING) {
        printf("%s ", NAMES[kind]);
        for (size_t i = 0; i < length; i++) printf("%02x", sent[i]);
        printf("\n");
    }
    printf("tick %d %d %a %a %a %a %a %" PRIu32 " %" PRIu32 " %" PRIu32 " %d %d ", agent.phase,
           agent.fault, (double)agent.drive_speed, (double)agent.drive_curvature,
           (double)agent.drive_distance, (double)agent.drive_turn, (double)sf_place_on_path(&agent),
           agent.epoch, agent.revision, agent.holds, sf_may_leave(&agent),
           sf_is_reading(&agent));
    if (sf_coordinator_time(&agent, now_ns, &time_ns)) printf("%" PRId64 "\n", time_ns);
    else printf("-\n");
}

static void begin(char *rest) {
    double numbers[4];
    rest += strspn(rest, " ");
    size_t length = strcspn(rest, " ");
    if (length >= sizeof id) length = sizeof id - 1;
    memcpy(id, rest, length);
    id[length] = 0;
    rest += length;
    for (int i = 0; i < 4; i++) numbers[i] = strtod(rest, &rest);
    robot.id = id;
    robot.radius = numbers[0];
    robot.max_speed = numbers[1];
    robot.max_accel = numbers[2];
    robot.speed_limit = (sf_real)numbers[3];
    robot.boot = (uint32_t)strtoul(rest, &rest, 10);
    robot.period_ns = strtoll(rest, &rest, 10);
    sf_init(&agent, &robot);
}

int main(void) {
    while (fgets(line, sizeof line, stdin)) {
        char *rest = line + strcspn(line, " \n");
        line[strcspn(line, "\n")] = 0;
        if (*rest) *rest++ = 0;
        if (strcmp(line, "robot") == 0) {
            begin(rest);
        } else if (strcmp(line, "command") == 0) {
            hear(SF_COMMAND, rest);
        } else if (strcmp(line, "plan") == 0) {
            hear(SF_PLAN, rest);
        } else if (strcmp(line, "clock") == 0) {
            hear(SF_CLOCK, rest);
        } else if (strcmp(line, "tick") == 0) {
            tick(rest);
        } else if (strcmp(line, "failed") == 0) {
            sf_driver_failed(&agent, strtoll(rest, NULL, 10));
        } else if (strcmp(line, "size") == 0) {
            printf("size %zu\n", sizeof agent);
        } else {
            return 2;
        }
        fflush(stdout);
    }
    return 0;
}
