/* The law as an FMU of FMI 2.0 for co-simulation. Functions without use here refuse. */
#include <stdlib.h>

#include "law.h"

typedef struct {
    void (*log)(void *, const char *, int, const char *, const char *, ...);
    void *(*allocate)(size_t, size_t);
    void (*release)(void *);
    void (*step_finished)(void *, int);
    void *environment;
} Callbacks;

static const Callbacks *callbacks;

static void log_message(void *environment, int status, const char *category, const char *message) {
    callbacks->log(environment, "law", status, category, "%s (%d)", message, 42);
}

const char *fmi2GetTypesPlatform(void) { return "default"; }
const char *fmi2GetVersion(void) { return "2.0"; }

void *fmi2Instantiate(const char *name, int type, const char *guid, const char *resources, const Callbacks *given, int visible, int logs) {
    (void)name, (void)type, (void)guid, (void)resources, (void)visible, (void)logs;
    callbacks = given;
    Law *law = calloc(1, sizeof *law);
    law->log = log_message;
    law->log_of = given->environment;
    return law;
}

void fmi2FreeInstance(void *law) { free(law); }

int fmi2SetReal(Law *law, const unsigned *references, size_t number, const double *values) { return set_reals(law, references, number, values); }
int fmi2GetReal(Law *law, const unsigned *references, size_t number, double *values) { return get_reals(law, references, number, values); }

int fmi2SetInteger(Law *law, const unsigned *references, size_t number, const int *values) {
    if (number != 1 || references[0] != MISBEHAVIOUR) return ERROR;
    law->misbehaviour = values[0];
    return OK;
}

int fmi2DoStep(Law *law, double now_s, double step_s, int no_earlier) {
    (void)step_s, (void)no_earlier;
    return step(law, now_s);
}

#define ACCEPT(name) int name(void *law) { (void)law; return OK; }
#define REFUSE(name) int name(void *law) { (void)law; return ERROR; }
ACCEPT(fmi2SetDebugLogging) ACCEPT(fmi2SetupExperiment) ACCEPT(fmi2EnterInitializationMode) ACCEPT(fmi2ExitInitializationMode)
ACCEPT(fmi2Terminate) ACCEPT(fmi2Reset)
REFUSE(fmi2GetInteger) REFUSE(fmi2GetBoolean) REFUSE(fmi2GetString) REFUSE(fmi2SetBoolean) REFUSE(fmi2SetString)
REFUSE(fmi2GetFMUstate) REFUSE(fmi2SetFMUstate) REFUSE(fmi2FreeFMUstate) REFUSE(fmi2SerializedFMUstateSize)
REFUSE(fmi2SerializeFMUstate) REFUSE(fmi2DeSerializeFMUstate) REFUSE(fmi2GetDirectionalDerivative)
REFUSE(fmi2SetRealInputDerivatives) REFUSE(fmi2GetRealOutputDerivatives) REFUSE(fmi2CancelStep) REFUSE(fmi2GetStatus)
REFUSE(fmi2GetRealStatus) REFUSE(fmi2GetIntegerStatus) REFUSE(fmi2GetBooleanStatus) REFUSE(fmi2GetStringStatus)
