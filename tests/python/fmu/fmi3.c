/* The law as an FMU of FMI 3.0 for co-simulation. Functions without use here refuse. */
#include <stdbool.h>
#include <stdlib.h>

#include "law.h"

const char *fmi3GetVersion(void) { return "3.0"; }

void *fmi3InstantiateCoSimulation(const char *name, const char *token, const char *resources, bool visible, bool logs, bool has_events,
                                  bool may_return_early, const unsigned *required, size_t number, void *environment, Log log, void *update) {
    (void)name, (void)token, (void)resources, (void)visible, (void)logs, (void)has_events, (void)may_return_early;
    (void)required, (void)number, (void)update;
    Law *law = calloc(1, sizeof *law);
    law->log = log;
    law->log_of = environment;
    return law;
}

void fmi3FreeInstance(void *law) { free(law); }

int fmi3SetFloat64(Law *law, const unsigned *references, size_t number, const double *values, size_t all) {
    return number == all ? set_reals(law, references, number, values) : ERROR;
}

int fmi3GetFloat64(Law *law, const unsigned *references, size_t number, double *values, size_t all) {
    return number == all ? get_reals(law, references, number, values) : ERROR;
}

int fmi3SetInt32(Law *law, const unsigned *references, size_t number, const int32_t *values, size_t all) {
    if (number != 1 || all != 1 || references[0] != MISBEHAVIOUR) return ERROR;
    law->misbehaviour = values[0];
    return OK;
}

int fmi3DoStep(Law *law, double now_s, double step_s, bool no_earlier, bool *needs_events, bool *ends, bool *is_early, double *reached_s) {
    (void)no_earlier;
    *needs_events = *is_early = false;
    *reached_s = now_s + step_s;
    *ends = law->misbehaviour == ENDS && now_s >= law->real[BAD_AFTER_S];
    return step(law, now_s);
}

#define ACCEPT(name) int name(void *law) { (void)law; return OK; }
#define REFUSE(name) int name(void *law) { (void)law; return ERROR; }
ACCEPT(fmi3SetDebugLogging) ACCEPT(fmi3EnterInitializationMode) ACCEPT(fmi3ExitInitializationMode) ACCEPT(fmi3Terminate) ACCEPT(fmi3Reset)
REFUSE(fmi3InstantiateModelExchange) REFUSE(fmi3InstantiateScheduledExecution) REFUSE(fmi3EnterEventMode) REFUSE(fmi3EnterStepMode)
REFUSE(fmi3GetFloat32) REFUSE(fmi3GetInt8) REFUSE(fmi3GetUInt8) REFUSE(fmi3GetInt16) REFUSE(fmi3GetUInt16) REFUSE(fmi3GetInt32)
REFUSE(fmi3GetUInt32) REFUSE(fmi3GetInt64) REFUSE(fmi3GetUInt64) REFUSE(fmi3GetBoolean) REFUSE(fmi3GetString) REFUSE(fmi3GetBinary)
REFUSE(fmi3GetClock) REFUSE(fmi3SetFloat32) REFUSE(fmi3SetInt8) REFUSE(fmi3SetUInt8) REFUSE(fmi3SetInt16) REFUSE(fmi3SetUInt16)
REFUSE(fmi3SetUInt32) REFUSE(fmi3SetInt64) REFUSE(fmi3SetUInt64) REFUSE(fmi3SetBoolean) REFUSE(fmi3SetString) REFUSE(fmi3SetBinary)
REFUSE(fmi3SetClock) REFUSE(fmi3GetNumberOfVariableDependencies) REFUSE(fmi3GetVariableDependencies) REFUSE(fmi3GetFMUState)
REFUSE(fmi3SetFMUState) REFUSE(fmi3FreeFMUState) REFUSE(fmi3SerializedFMUStateSize) REFUSE(fmi3SerializeFMUState)
REFUSE(fmi3DeserializeFMUState) REFUSE(fmi3GetDirectionalDerivative) REFUSE(fmi3GetAdjointDerivative)
REFUSE(fmi3EnterConfigurationMode) REFUSE(fmi3ExitConfigurationMode) REFUSE(fmi3GetIntervalDecimal) REFUSE(fmi3GetIntervalFraction)
REFUSE(fmi3GetShiftDecimal) REFUSE(fmi3GetShiftFraction) REFUSE(fmi3SetIntervalDecimal) REFUSE(fmi3SetIntervalFraction)
REFUSE(fmi3SetShiftDecimal) REFUSE(fmi3SetShiftFraction) REFUSE(fmi3EvaluateDiscreteStates) REFUSE(fmi3UpdateDiscreteStates)
REFUSE(fmi3GetOutputDerivatives) REFUSE(fmi3ActivateModelPartition) REFUSE(fmi3CompletedIntegratorStep)
REFUSE(fmi3EnterContinuousTimeMode) REFUSE(fmi3GetContinuousStateDerivatives) REFUSE(fmi3GetContinuousStates)
REFUSE(fmi3GetEventIndicators) REFUSE(fmi3GetNominalsOfContinuousStates) REFUSE(fmi3GetNumberOfContinuousStates)
REFUSE(fmi3GetNumberOfEventIndicators) REFUSE(fmi3SetContinuousStates) REFUSE(fmi3SetTime)
