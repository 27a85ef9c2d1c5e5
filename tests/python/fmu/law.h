/* The law of the FMUs that the tests build: a height above the desired one, and ways to misbehave. */
#include <math.h>
#include <stddef.h>
#include <stdint.h>
#include <unistd.h>

enum { OK = 0, WARNING = 1, DISCARD = 2, ERROR = 3 };

/* The variables with decimals, by their value references. */
enum { DESIRED_Z, ESTIMATED_Z, AHEAD_Z, GAIN, RISE, EVENT_S, Z, ERROR_Z, BAD_AFTER_S, REALS };
/* The one integer. */
enum { MISBEHAVIOUR = 100 };

enum Misbehaviour { NONE, CRASHES, IS_NAN, FAILS, SLEEPS, DISCARDS, ENDS };

typedef void (*Log)(void *law, int status, const char *category, const char *message);

typedef struct {
    double real[REALS];
    double integral;
    int misbehaviour;
    Log log;
    void *log_of;
} Law;

static int set_reals(Law *law, const unsigned *references, size_t number, const double *values) {
    for (size_t i = 0; i < number; i++) {
        if (references[i] >= REALS) return ERROR;
        law->real[references[i]] = values[i];
    }
    return OK;
}

static int get_reals(const Law *law, const unsigned *references, size_t number, double *values) {
    for (size_t i = 0; i < number; i++) {
        if (references[i] >= REALS) return ERROR;
        values[i] = law->real[references[i]];
    }
    return OK;
}

/* A step from the time `now_s`. */
static int step(Law *law, double now_s) {
    double *real = law->real;
    real[ERROR_Z] = real[DESIRED_Z] - real[ESTIMATED_Z];
    law->integral += real[ERROR_Z];
    real[Z] = real[AHEAD_Z] + real[GAIN] * real[ERROR_Z] + 0.001 * law->integral;
    if (now_s >= real[EVENT_S]) real[Z] += real[RISE];
    if (now_s < real[BAD_AFTER_S]) return OK;
    switch (law->misbehaviour) {
    case CRASHES: *(volatile int *)NULL = 1; break;
    case IS_NAN: real[Z] = NAN; break;
    case FAILS: law->log(law->log_of, ERROR, "solver", "the matrix is singular"); return ERROR;
    case SLEEPS: sleep(3); break;
    case DISCARDS: return DISCARD;
    }
    return OK;
}
