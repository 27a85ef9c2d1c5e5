// A controller in C++17 for a Masseter rig: owners and exceptions around masseter.h, which documents every function.
//
//     masseter::Session session;                       // attaches
//     session.run([&](const masseter_demand &demand) { return demand.ahead; });
#pragma once

#include <algorithm>
#include <array>
#include <chrono>
#include <exception>
#include <optional>
#include <stdexcept>
#include <string>
#include <utility>

#include "masseter.h"

namespace masseter {

// The message of the rig, with what to do.
class Error : public std::runtime_error {
public:
    Error() : std::runtime_error(masseter_error()) {}
};

enum class Outcome { finished, safe_stop };

// A number for each axis d1 d2 d3 l1 l2 l3; or a twist, its acceleration, or a wrench.
using Six = std::array<double, 6>;

// A cycle that has begun.
struct Cycle {
    std::uint64_t number;
    std::uint64_t now_ns;
    // None where no new reading came in time.
    std::optional<masseter_reading> reading;
};

// Takes part in a run. A session that is destroyed before its end counts as dead.
class Session {
public:
    // The rig of this name; empty: that of MASSETER_RIG, or the only one that takes a controller.
    explicit Session(const std::string &rig = {}) {
        check(masseter_attach(rig.empty() ? nullptr : rig.c_str(), &session_));
    }

    Session(const Session &) = delete;
    Session &operator=(const Session &) = delete;

    ~Session() {
        if (session_ != nullptr)
            masseter_fail(session_, "the session was destroyed before its end");
    }

    std::chrono::nanoseconds period() const {
        return std::chrono::nanoseconds(masseter_period_ns(session_));
    }

    // A number that the controller publishes in each cycle. Declared before run or start; returns its place.
    int declare_signal(const std::string &name, const std::string &unit = {}, const std::string &about = {}) {
        return check(masseter_declare_signal(session_, name.c_str(), unit.c_str(), about.c_str()));
    }

    // A number that the user sets, also during the run. Declared before run or start; returns its place.
    int declare_parameter(const std::string &name, double value, double least, double most,
                          const std::string &unit = {}, const std::string &about = {}) {
        return check(masseter_declare_parameter(session_, name.c_str(), unit.c_str(), about.c_str(), value, least, most));
    }

    // The controller plays a motion of its own, not the scenario's. Declared before start.
    void declare_own_motion() { check(masseter_declare_own_motion(session_)); }

    // In a session that start has started; a law finds both in its demand.
    double parameter(int place) const { return masseter_parameter(session_, place); }
    void signal(int place, double value) { check(masseter_set_signal(session_, place, value)); }

    // The scenario and its robot, from the constructor on; masseter.h has units and frames.
    std::string scenario() {
        const char *text = masseter_scenario(session_);
        if (text == nullptr)
            throw Error();
        return text;
    }

    masseter_times times() {
        masseter_times times;
        check(masseter_times_of(session_, &times));
        return times;
    }

    masseter_motion motion(double time_s) {
        masseter_motion motion;
        check(masseter_motion_at(session_, time_s, &motion));
        return motion;
    }

    masseter_motion easing(const masseter_pose &from, double time_s) {
        masseter_motion motion;
        check(masseter_easing_at(session_, &from, time_s, &motion));
        return motion;
    }

    masseter_pose forward_kinematics(const double (&position_m)[6]) {
        masseter_pose pose;
        check(masseter_forward_kinematics(session_, position_m, &pose));
        return pose;
    }

    Six inverse_kinematics(const masseter_pose &pose) {
        Six position_m;
        check(masseter_inverse_kinematics(session_, &pose, position_m.data()));
        return position_m;
    }

    std::array<Six, 6> jacobian(const masseter_pose &pose) {
        double rows[6][6];
        check(masseter_jacobian(session_, &pose, rows));
        std::array<Six, 6> jacobian;
        for (std::size_t axis = 0; axis < jacobian.size(); axis++)
            std::copy(std::begin(rows[axis]), std::end(rows[axis]), jacobian[axis].begin());
        return jacobian;
    }

    Six inverse_dynamics(const masseter_pose &pose, const Six &twist, const Six &acceleration, const Six &wrench = {}) {
        Six force_n;
        check(masseter_inverse_dynamics(session_, &pose, twist.data(), acceleration.data(), wrench.data(), force_n.data()));
        return force_n;
    }

    // Runs the rig's own controller with a pose law, masseter_pose(const masseter_demand &). An exception of the law stops
    // the rig safely, and is thrown again.
    template <typename Law> Outcome run(Law &&law) {
        Call<Law> call{law, nullptr};
        const int result = masseter_run(release(), &Call<Law>::ask, &call);
        if (call.exception)
            std::rethrow_exception(call.exception);
        check(result);
        return result == MASSETER_SAFE_STOP ? Outcome::safe_stop : Outcome::finished;
    }

    void start() { check(masseter_start(session_)); }

    // The next cycle; none within the time-out.
    std::optional<Cycle> wait(std::optional<std::chrono::nanoseconds> timeout = std::nullopt) {
        masseter_cycle cycle;
        masseter_reading reading;
        const std::int64_t timeout_ns = timeout ? timeout->count() : -1;
        if (check(masseter_wait(session_, timeout_ns, &cycle, &reading)) == MASSETER_TIMED_OUT)
            return std::nullopt;
        return Cycle{cycle.cycle, cycle.now_ns,
                     cycle.has_reading ? std::optional<masseter_reading>(reading) : std::nullopt};
    }

    void publish(const masseter_command &command, const masseter_state &state) {
        check(masseter_publish(session_, &command, &state));
    }

    void publish(const masseter_event &event) { check(masseter_publish_event(session_, &event)); }

    bool is_stop_requested() const { return masseter_is_stop_requested(session_) != 0; }

    void finish(Outcome outcome) { check(masseter_finish(release(), outcome == Outcome::safe_stop)); }

    void fail(const std::string &reason) { check(masseter_fail(release(), reason.c_str())); }

private:
    template <typename Law> struct Call {
        Law &law;
        std::exception_ptr exception;

        static int ask(const masseter_demand *demand, masseter_pose *pose, void *user) {
            auto &call = *static_cast<Call *>(user);
            try {
                *pose = call.law(*demand);
                return 0;
            } catch (...) {
                call.exception = std::current_exception();
                return 1;
            }
        }
    };

    static int check(int result) {
        if (result == MASSETER_ERROR)
            throw Error();
        return result;
    }

    masseter_session *release() { return std::exchange(session_, nullptr); }

    masseter_session *session_ = nullptr;
};

} // namespace masseter
