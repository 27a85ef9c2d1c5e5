// A pose controller: an integral of the position error is added to the desired pose.
#include <array>
#include <cmath>
#include <iostream>
#include <masseter.hpp>

constexpr double limit_m = 1e-3; // the most that is added

struct IntegralLaw {
    int gain, trim; // places of the parameter and the signal
    std::array<double, 3> trim_m{};

    explicit IntegralLaw(masseter::Session &session)
        : gain(session.declare_parameter("gain", 5.0, 0.0, 100.0, "1/s", "Integral gain.")),
          trim(session.declare_signal("trim", "mm", "Length of the correction.")) {}

    masseter_pose operator()(const masseter_demand &demand) {
        if (demand.has_estimate) {
            const double share = demand.parameters[gain] * demand.period_s;
            for (std::size_t i = 0; i < 3; i++)
                trim_m[i] += (demand.desired.position_m[i] - demand.estimated.position_m[i]) * share;
            const double length_m =
                std::sqrt(trim_m[0] * trim_m[0] + trim_m[1] * trim_m[1] + trim_m[2] * trim_m[2]);
            for (std::size_t i = 0; i < 3 && length_m > limit_m; i++)
                trim_m[i] *= limit_m / length_m;
            demand.signals[trim] = 1e3 * length_m;
        }
        masseter_pose pose = demand.ahead;
        for (std::size_t i = 0; i < 3; i++)
            pose.position_m[i] += trim_m[i];
        return pose;
    }
};

int main() {
    try {
        masseter::Session session;
        session.run(IntegralLaw(session));
        return 0;
    } catch (const std::exception &error) {
        std::cerr << "my_controller: " << error.what() << '\n';
        return 1;
    }
}
