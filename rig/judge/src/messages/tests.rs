use super::*;

mod digest {
    use masseter_runtime::messages::{Command, Reading, State};

    use super::*;

    fn digest(messages: &[Recorded]) -> String {
        let mut digest = Digest::default();
        for message in messages {
            digest.add_message(message);
        }
        digest.in_hex()
    }

    #[test]
    fn what_the_rig_did_counts_and_when_does_not() {
        let (command, reading) = (Command { cycle: 1, ..Command::default() }, Reading::default());
        let state = State { cycle: 1, woke_ns: 5, ..State::default() };
        let plain = digest(&[command.into(), reading.into(), state.into()]);
        assert_eq!(digest(&[state.into(), command.into(), reading.into()]), plain, "topic after topic");
        let later = State { woke_ns: 6, ..state };
        assert_eq!(digest(&[command.into(), reading.into(), later.into()]), plain);
        let (mut moved, mut off, mut elsewhere) = (command, reading, state);
        (moved.target_m[5], off.drive_state[5], elsewhere.desired_position_m[2]) = (1e-9, 3, 1e-9);
        let changed = [
            digest(&[moved.into(), reading.into(), state.into()]),
            digest(&[command.into(), off.into(), state.into()]),
            digest(&[command.into(), reading.into(), elsewhere.into()]),
            digest(&[command.into(), command.into(), reading.into(), state.into()]),
        ];
        assert!(changed.iter().all(|digest| *digest != plain), "{changed:?} {plain}");
    }
}

mod sequence {
    use masseter_runtime::messages::Reading;

    use super::*;

    #[test]
    fn gaps_are_counted_at_the_beginning_and_between_for_each_publisher() {
        let mut check = SequenceCheck::default();
        let mut event = |source: Source, seq| {
            check.take(&Recorded::Event(Event { seq, source: source.code(), ..Event::default() }));
        };
        for seq in [3, 4, 7] {
            event(Source::Controller, seq);
        }
        // One process.
        event(Source::Master, 1);
        event(Source::Drive, 2);
        check.take(&Recorded::Reading(Reading { seq: 1, ..Reading::default() }));
        assert_eq!(
            check.finish(),
            [
                TopicFigures { topic: "event", messages: 5, missing: 4 },
                TopicFigures { topic: "reading", messages: 1, missing: 0 },
            ]
        );
    }
}

mod named {
    use masseter_runtime::messages::Values;

    use super::*;

    fn values(given: &[f64]) -> Values {
        let mut values = Values::zeros(given.len());
        values.as_mut_slice().copy_from_slice(given);
        values
    }

    #[test]
    fn signals_have_extremes_and_mean_and_changes_of_parameters_are_counted() {
        let signals = [Signal { name: "a".into(), unit: "mm".into(), about: String::new() }];
        let mut signals = signals.iter().map(SignalFigures::new).collect::<Vec<_>>();
        let mut parameters = vec![ParameterFigures::new(&Parameter::new("gain", 1.0))];
        for value in [2.0, f64::NAN, -1.0, 5.0] {
            let message = Signals { signals: values(&[value]), ..Signals::default() };
            SignalFigures::add_all(&mut signals, &message);
        }
        for value in [1.0, 3.0, 3.0, 2.0] {
            let message = Parameters { parameters: values(&[value]), ..Parameters::default() };
            ParameterFigures::add_all(&mut parameters, &message);
        }
        let SignalFigures { values, not_finite, min, mean, max, last, .. } = signals[0];
        assert_eq!((values, not_finite), (3, 1));
        assert_eq!([min, mean, max, last], [Some(-1.0), Some(2.0), Some(5.0), Some(5.0)]);
        assert_eq!((parameters[0].parameter.value, parameters[0].last, parameters[0].changes), (1.0, 2.0, 2));
    }
}
