//! CiA 402: states, modes and homing.

use crate::client::{Client, EPOS4, N5, settings};
use canopen_node::{Quirks, Settings};

fn status(client: &mut Client) -> i64 {
    client.read(0x6041, 0).unwrap() & 0xFFFF
}

#[test]
fn controlwords_lead_through_the_states_of_the_standard() {
    let mut client = Client::new(N5, settings());
    for (word, state) in [
        (0x0F, 0x40),
        (0x02, 0x40),
        (0x06, 0x21),
        (0x02, 0x40),
        (0x06, 0x21),
        (0x0F, 0x27),
        (0x07, 0x23),
        (0x06, 0x21),
        (0x07, 0x23),
        (0x0F, 0x27),
        (0x06, 0x21),
        (0x00, 0x40),
    ] {
        client.write(0x6040, 0, word, 2).unwrap();
        assert_eq!(status(&mut client) & 0x6F, state, "after {word:02X}h");
    }
    let quirks = Quirks { safe_torque_off: true, ..Quirks::default() };
    let mut client = Client::new(N5, Settings { quirks, ..settings() });
    client.write(0x6040, 0, 6, 2).unwrap();
    assert_eq!(status(&mut client) & 0x6F, 0x40, "safe torque off");
}

#[test]
fn profile_position_goes_to_its_target_at_its_velocity_within_the_limits() {
    let mut client = Client::new(EPOS4, Settings { position_increments: -500, ..settings() });
    client.write(0x6060, 0, 1, 1).unwrap();
    // 60 rpm of 2000 increments are 2000 increments/s.
    client.write(0x6081, 0, 60, 4).unwrap();
    client.enable();
    client.write(0x607A, 0, 500, 4).unwrap();
    client.write(0x6040, 0, 0x1F, 2).unwrap();
    assert_eq!(status(&mut client) & 0x1400, 0x1000, "acknowledged, not reached");
    client.wait_ms(250);
    assert_eq!((client.read(0x6064, 0), client.read(0x606C, 0)), (Ok(0), Ok(60)));
    assert_eq!(client.read(0x6077, 0), Ok(50));
    client.write(0x6040, 0, 0x010F, 2).unwrap();
    client.wait_ms(100);
    let halted = client.read(0x6064, 0).unwrap();
    assert!((0..100).contains(&halted), "{halted}");
    client.write(0x6040, 0, 0x0F, 2).unwrap();
    client.wait_ms(300);
    assert_eq!((client.read(0x6064, 0), status(&mut client) & 0x1400), (Ok(500), 0x0400));
    client.write(0x607D, 1, -100, 4).unwrap();
    client.write(0x607D, 2, 700, 4).unwrap();
    client.write(0x6040, 0, 0x5F, 2).unwrap();
    client.wait_ms(500);
    assert_eq!(
        (client.read(0x6064, 0), status(&mut client) & 0x0C00),
        (Ok(700), 0x0C00),
        "500 further, limited"
    );
}

#[test]
fn a_stop_in_the_way_is_a_following_error_that_a_rising_edge_resets() {
    let stops_increments = Some([-10_000, 10_000]);
    let mut client = Client::new(EPOS4, Settings { stops_increments, ..settings() });
    client.write(0x6060, 0, 1, 1).unwrap();
    client.enable();
    client.write(0x607A, 0, 100_000, 4).unwrap();
    client.write(0x6040, 0, 0x1F, 2).unwrap();
    client.wait_ms(1000);
    assert_eq!(status(&mut client) & 0x4F, 0x08);
    assert_eq!(client.take("085"), ["085#1186210000000000"]);
    assert_eq!((client.read(0x6064, 0), client.read(0x60FD, 0)), (Ok(10_000), Ok(2)));
    client.write(0x6040, 0, 0x80, 2).unwrap();
    assert_eq!(status(&mut client) & 0x4F, 0x40);
    assert_eq!(client.take("085"), ["085#0000000000000000"]);
}

#[test]
fn cyclic_position_takes_its_target_at_sync_and_arrives_a_period_later() {
    let mut client = Client::new(EPOS4, Settings { position_increments: 1000, ..settings() });
    client.map();
    client.write(0x60C2, 1, 10, 1).unwrap();
    client.write(0x6060, 0, 8, 1).unwrap();
    client.send(0, &[1, 5]);
    for word in [6, 7, 15] {
        client.send(0x205, &[word, 0, 0xE8, 3, 0, 0]);
        client.send(0x80, &[]);
        client.wait_ms(10);
    }
    assert_eq!(client.take("185"), ["185#2102E8030000", "185#3302E8030000", "185#3712E8030000"]);
    for step in 1..=3_u8 {
        client.send(0x205, &[15, 0, 0xE8 + step, 3, 0, 0]);
        client.wait_ms(5);
        client.send(0x80, &[]);
        client.wait_ms(5);
    }
    client.wait_ms(5);
    assert_eq!(client.read(0x6064, 0), Ok(1003));
    assert_eq!(status(&mut client) & 0x1000, 0x1000);
}

#[test]
fn homing_ends_where_the_maker_says() {
    // At the stop, then 30B1h back; 30B0h is what 6064h shows there.
    let axis = Settings { stops_increments: Some([-400, 400]), home_increments: 150, ..settings() };
    let mut client = Client::new(EPOS4, axis);
    client.write(0x6098, 0, -4, 1).unwrap();
    client.write(0x6099, 1, 60, 4).unwrap();
    client.write(0x30B0, 0, 7, 4).unwrap();
    client.write(0x30B1, 0, 100, 4).unwrap();
    client.write(0x6060, 0, 6, 1).unwrap();
    client.enable();
    client.write(0x6040, 0, 0x1F, 2).unwrap();
    assert_eq!(status(&mut client) & 0x3400, 0, "under way");
    client.wait_ms(300);
    assert_eq!((client.read(0x6064, 0), status(&mut client) & 0x3400), (Ok(7), 0x1400));
    // At the switch, with both signs of the home offset.
    for (is_positive, expected) in [(false, -20), (true, 20)] {
        let quirks = Quirks { is_home_offset_positive: is_positive, ..Quirks::default() };
        let mut client = Client::new(N5, Settings { quirks, ..axis });
        client.write(0x6098, 0, 1, 1).unwrap();
        client.write(0x607C, 0, 20, 4).unwrap();
        client.write(0x6060, 0, 6, 1).unwrap();
        client.enable();
        client.write(0x6040, 0, 0x1F, 2).unwrap();
        client.wait_ms(100);
        assert_eq!((client.read(0x6064, 0), status(&mut client) & 0x3400), (Ok(expected), 0x1400));
        assert_eq!(client.read(0x60FD, 0), Ok(4), "it stands on the switch");
    }
}

#[test]
fn homing_without_a_method_fails_and_here_is_a_method() {
    let mut client = Client::new(EPOS4, Settings { position_increments: 40, ..settings() });
    client.write(0x6060, 0, 6, 1).unwrap();
    client.enable();
    client.write(0x6040, 0, 0x1F, 2).unwrap();
    assert_eq!(status(&mut client) & 0x3400, 0x2400);
    client.write(0x6098, 0, 37, 1).unwrap();
    client.write(0x6040, 0, 0x0F, 2).unwrap();
    client.write(0x6040, 0, 0x1F, 2).unwrap();
    assert_eq!((client.read(0x6064, 0), status(&mut client) & 0x3400), (Ok(0), 0x1400));
}

#[test]
fn an_incremental_encoder_begins_at_zero_and_a_sync_shows_where_the_maker_shows_it() {
    let quirks = Quirks { is_incremental: true, shows_sync: true, ..Quirks::default() };
    let mut client = Client::new(N5, Settings { position_increments: 40, quirks, ..settings() });
    assert_eq!(client.read(0x6064, 0), Ok(0));
    client.write(0x6060, 0, 8, 1).unwrap();
    client.send(0, &[1, 5]);
    assert_eq!(status(&mut client) & 0x100, 0);
    client.send(0x80, &[]);
    assert_eq!(status(&mut client) & 0x100, 0x100);
}
