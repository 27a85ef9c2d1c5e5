/* A pose controller: an integral of the position error is added to the desired pose. */
#include <masseter.h>
#include <math.h>
#include <stdio.h>

#define GAIN_PER_S 5.0 /* integral gain */
#define LIMIT_M 1e-3   /* the most that is added */

typedef struct integral_law {
    double trim_m[3];
} integral_law;

static int command(const masseter_demand *demand, masseter_pose *pose, void *user) {
    integral_law *law = user;
    double *trim_m = law->trim_m;
    if (demand->has_estimate) {
        const double share = GAIN_PER_S * demand->period_s;
        for (int i = 0; i < 3; i++)
            trim_m[i] += (demand->desired.position_m[i] - demand->estimated.position_m[i]) * share;
        const double length_m = sqrt(trim_m[0] * trim_m[0] + trim_m[1] * trim_m[1] + trim_m[2] * trim_m[2]);
        for (int i = 0; i < 3 && length_m > LIMIT_M; i++)
            trim_m[i] *= LIMIT_M / length_m;
    }
    for (int i = 0; i < 3; i++)
        pose->position_m[i] += trim_m[i]; /* pose holds demand->ahead */
    return 0;
}

int main(void) {
    integral_law law = {{0.0, 0.0, 0.0}};
    masseter_session *session;
    if (masseter_attach(NULL, &session) < 0 || masseter_run(session, command, &law) < 0) {
        fprintf(stderr, "my_controller: %s\n", masseter_error());
        return 1;
    }
    return 0;
}
