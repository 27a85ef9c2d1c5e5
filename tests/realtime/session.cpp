// A controller of the drives that leaves them without voltage: only its transport is of interest. Argument: blocking or polling.
#include <chrono>
#include <cstring>
#include <iostream>
#include <masseter.hpp>

int main(int, char **argv) {
    const bool is_polling = std::strcmp(argv[1], "polling") == 0;
    try {
        masseter::Session session;
        session.start();
        std::uint64_t reading_cycle = 0;
        for (int cycles = 0; cycles < 5000 && !session.is_stop_requested(); cycles++) {
            auto cycle = session.wait(is_polling ? std::optional(std::chrono::nanoseconds(0)) : std::nullopt);
            while (!cycle)
                cycle = session.wait(std::chrono::nanoseconds(0));
            if (cycle->reading)
                reading_cycle = cycle->reading->cycle;
            masseter_command command{};
            command.cycle = cycle->number;
            command.reading_cycle = reading_cycle;
            masseter_state state{};
            state.cycle = cycle->number;
            state.reading_cycle = reading_cycle;
            session.publish(command, state);
        }
        session.finish(masseter::Outcome::finished);
        return 0;
    } catch (const std::exception &error) {
        std::cerr << "session: " << error.what() << '\n';
        return 1;
    }
}
