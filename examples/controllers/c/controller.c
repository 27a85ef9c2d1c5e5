/* A pose controller: an integral of the position error is added to the desired pose. */
#include <masseter.h>
#include <math.h>
#include <stdio.h>

#define LIMIT_M 1e-3 /* the most that is added */

typedef struct integral_law {
    double trim_m[3];
    int gain, trim; /* places of the parameter and the signal */
} integral_law;

static int command(const masseter_demand *demand, masseter_pose *pose, void *user) {
    integral_law *law = user;
    double *trim_m = law->trim_m;
    if (demand->has_estimate) {
        const double share = demand->parameters[law->gain] * demand->period_s;
        for (int i = 0; i < 3; i++)
            trim_m[i] += (demand->desired.position_m[i] - demand->estimated.position_m[i]) * share;
        const double length_m = sqrt(trim_m[0] * trim_m[0] + trim_m[1] * trim_m[1] + trim_m[2] * trim_m[2]);
        for (int i = 0; i < 3 && length_m > LIMIT_M; i++)
            trim_m[i] *= LIMIT_M / length_m;
        demand->signals[law->trim] = 1e3 * length_m;
    }
    for (int i = 0; i < 3; i++)
        pose->position_m[i] += trim_m[i]; /* pose holds demand->ahead */
    return 0;
}

static int failed(void) {
    fprintf(stderr, "my_controller: %s\n", masseter_error());
    return 1;
}

int main(void) {
    integral_law law = {{0.0, 0.0, 0.0}, 0, 0};
    masseter_session *session;
    if (masseter_attach(NULL, &session) < 0)
        return failed();
    law.gain = masseter_declare_parameter(session, "gain", "1/s", "Integral gain.", 5.0, 0.0, 100.0);
    law.trim = masseter_declare_signal(session, "trim", "mm", "Length of the correction.");
    if (law.gain < 0 || law.trim < 0 || masseter_run(session, command, &law) < 0)
        return failed();
    return 0;
}
