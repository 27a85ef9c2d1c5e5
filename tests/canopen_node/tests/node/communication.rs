//! CiA 301: what a master may read, write and map, and when the node sends.

use crate::client::{Client, EPOS4, N5, settings};
use canopen_node::{Dcf, Node, Quirks, Settings};

const NOT_VALID: i64 = 0x8000_0000;

#[test]
fn identity_and_texts_are_those_of_the_description() {
    let mut client = Client::new(EPOS4, settings());
    let identity = [1, 2, 3, 4].map(|subindex| client.read(0x1018, subindex).unwrap());
    assert_eq!(identity, [0xFB, 0x6552_0000, 0x0170_0000, 77]);
    assert_eq!(client.read_text(0x1008), "EPOS4-like test drive");
    // COB-IDs follow from the node id.
    assert_eq!(client.read(0x1400, 1), Ok(0x205));
}

#[test]
fn every_refusal_has_the_code_of_its_reason() {
    let mut client = Client::new(EPOS4, settings());
    assert_eq!(client.read(0x6007, 1), Err(0x0609_0011));
    assert_eq!(client.read(0x607C, 0), Err(0x0602_0000), "it has 30B0h instead");
    for (index, subindex, number, bytes, code) in [
        (0x1018, 1, 0, 4, 0x0601_0002),
        (0x1005, 0, 0x80, 4, 0x0601_0002),
        (0x6065, 0, 1, 2, 0x0607_0013),
        (0x6040, 0, 1, 4, 0x0607_0012),
        (0x6066, 0, 20, 2, 0x0609_0031),
        (0x60AA, 0, 0, 4, 0x0609_0032),
        (0x60C2, 1, 101, 1, 0x0609_0031),
        (0x6060, 0, 7, 1, 0x0609_0030),
        (0x1010, 1, 1, 4, 0x0800_0020),
    ] {
        assert_eq!(client.write(index, subindex, number, bytes), Err(code), "{index:04X}h");
    }
    // The kinds of transfer that it does not serve, and a segment of none.
    assert_eq!(client.ask([0xA0, 8, 0x10, 0, 0, 0, 0, 0])[4..], 0x0504_0001_u32.to_le_bytes());
    assert_eq!(client.ask([0x60, 0, 0, 0, 0, 0, 0, 0])[4..], 0x0504_0001_u32.to_le_bytes());
    client.ask([0x40, 8, 0x10, 0, 0, 0, 0, 0]);
    assert_eq!(client.ask([0x70, 0, 0, 0, 0, 0, 0, 0])[4..], 0x0503_0000_u32.to_le_bytes(), "toggle");
}

#[test]
fn a_mapping_changes_only_by_the_procedure_of_the_standard() {
    let mut client = Client::new(EPOS4, settings());
    let controlword = 0x6040_0010;
    assert_eq!(client.write(0x1600, 0, 0, 1), Err(0x0800_0022), "the PDO is valid");
    assert_eq!(client.write(0x1400, 1, 0x305, 4), Err(0x0609_0030), "another identifier while it is valid");
    client.write(0x1400, 1, NOT_VALID | 0x205, 4).unwrap();
    assert_eq!(client.write(0x1600, 1, controlword, 4), Err(0x0601_0002), "the mapping counts");
    client.write(0x1600, 0, 0, 1).unwrap();
    for wrong in [0x6041_0010, 0x6040_0020, 0x6065_0020, 0x607C_0020] {
        assert_eq!(client.write(0x1600, 1, wrong, 4), Err(0x0604_0041), "{wrong:08X}h");
    }
    client.write(0x1600, 1, controlword, 4).unwrap();
    assert_eq!(client.write(0x1600, 0, 2, 1), Err(0x0604_0041), "the second place is empty");
    assert_eq!(client.write(0x1600, 0, 5, 1), Err(0x0604_0042), "it has four places");
    for place in 2..=4 {
        client.write(0x1600, place, 0x607A_0020, 4).unwrap();
    }
    assert_eq!(client.write(0x1600, 0, 4, 1), Err(0x0604_0042), "14 bytes");
    client.write(0x1600, 0, 2, 1).unwrap();
    assert_eq!(client.write(0x1400, 1, 0x605, 4), Err(0x0609_0030), "an identifier of SDO");
    client.write(0x1400, 1, 0x205, 4).unwrap();
    assert_eq!(client.write(0x1800, 3, 0, 2), Err(0x0800_0022), "inhibit time of a valid PDO");
}

#[test]
fn process_data_follow_their_transmission_types() {
    let mut client = Client::new(EPOS4, settings());
    client.send(0, &[1, 5]);
    client.wait_ms(1);
    assert_eq!(client.take("185"), ["185#4002"], "type 255: once at the start");
    client.wait_ms(10);
    client.send(0x205, &[6, 0]);
    client.wait_ms(1);
    assert_eq!(client.take("185"), ["185#2102"], "and at a change");
    client.send(0, &[0x80, 5]);
    client.map();
    client.write(0x1800, 1, NOT_VALID | 0x185, 4).unwrap();
    client.write(0x1800, 2, 3, 1).unwrap();
    client.write(0x1800, 1, 0x185, 4).unwrap();
    client.send(0, &[1, 0]);
    client.send(0x205, &[7, 0, 0, 0, 0, 0]);
    assert_eq!(client.read(0x6040, 0), Ok(6), "synchronous: it waits");
    client.send(0x80, &[]);
    assert_eq!(client.read(0x6040, 0), Ok(7));
    (0..5).for_each(|_| client.send(0x80, &[]));
    assert_eq!(client.take("185").len(), 2, "every third SYNC");
    client.send(0x205, &[7, 0]);
    client.send(0x80, &[]);
    assert_eq!(client.take("085"), ["085#1082110000000000"], "a frame that is too short");
}

#[test]
fn a_node_boots_once_or_twice_and_beats_as_it_is_told() {
    let mut client = Client::new(EPOS4, settings());
    assert_eq!(client.take("705"), ["705#00"]);
    client.write(0x1017, 0, 100, 2).unwrap();
    client.wait_ms(250);
    client.send(0, &[1, 5]);
    client.wait_ms(100);
    client.send(0, &[2, 5]);
    client.wait_ms(100);
    assert_eq!(client.take("705"), ["705#7F", "705#7F", "705#05", "705#04"]);
    client.take("185");
    client.send(0x605, &[0x40, 0, 0x10, 0, 0, 0, 0, 0]);
    assert_eq!(client.heard, [""; 0], "a stopped node serves no SDO");
    client.send(0, &[0x82, 5]);
    assert_eq!((client.take("705"), client.read(0x1017, 0)), (vec!["705#00".to_owned()], Ok(0)));
    let quirks = Quirks { boot_loader: true, ..Quirks::default() };
    let mut client = Client::new(N5, Settings { quirks, ..settings() });
    client.send(0x605, &[0x40, 0, 0x10, 0, 0, 0, 0, 0]);
    assert_eq!(client.heard, ["705#00"], "the boot loader serves no SDO");
    client.wait_ms(101);
    assert_eq!(client.take("705"), ["705#00", "705#00"]);
    assert!(client.read(0x1000, 0).is_ok());
    client.send(0, &[0x82, 5]);
    assert!(client.read(0x1000, 0).is_ok(), "the boot loader has no part in a reset of the communication");
    client.send(0, &[0x81, 5]);
    client.wait_ms(101);
    assert_eq!(client.take("705").len(), 3);
}

#[test]
fn parameters_of_pdos_are_closed_in_operational_where_the_maker_says_so() {
    for (is_closed, expected) in [(true, Err(0x0800_0022)), (false, Ok(()))] {
        let quirks = Quirks { pdos_closed_in_operational: is_closed, ..Quirks::default() };
        let mut client = Client::new(N5, Settings { quirks, ..settings() });
        client.send(0, &[1, 0]);
        assert_eq!(client.write(0x1400, 2, 1, 1), expected);
        client.send(0, &[0x80, 0]);
        assert_eq!(client.write(0x1400, 2, 1, 1), Ok(()));
    }
}

#[test]
fn saved_values_survive_a_reset_and_a_new_start_until_the_defaults_are_restored() {
    let quirks = Quirks { save_ms: 3000, ..Quirks::default() };
    let settings = Settings { quirks, ..settings() };
    let mut client = Client::new(N5, settings);
    client.map();
    client.write(0x6065, 0, 123, 4).unwrap();
    client.write(0x1010, 1, 0x6576_6173, 4).unwrap();
    assert_eq!(client.read(0x1010, 2), Ok(0), "it is busy");
    assert_eq!(client.node.to_store(), None);
    client.wait_ms(3000);
    assert_eq!(client.read(0x1010, 2), Ok(1));
    let stored = client.node.to_store().unwrap();
    client.write(0x6065, 0, 5, 4).unwrap();
    client.send(0, &[0x81, 5]);
    assert_eq!((client.read(0x6065, 0), client.read(0x1600, 2)), (Ok(123), Ok(0x607A_0020)));

    let node = Node::new(&Dcf::parse(N5).unwrap(), settings, &stored, 0).unwrap();
    let mut client = Client { node, heard: Vec::new(), now_ns: 0 };
    assert_eq!(client.read(0x6065, 0), Ok(123));
    client.write(0x1011, 1, 0x6461_6F6C, 4).unwrap();
    assert_eq!(client.read(0x6065, 0), Ok(123), "defaults come with the reset");
    client.wait_ms(3000);
    assert_eq!(client.node.to_store().as_deref(), Some(""));
    client.send(0, &[0x81, 0]);
    assert_eq!((client.read(0x6065, 0), client.read(0x1600, 0)), (Ok(2000), Ok(1)));
    let error = Node::new(&Dcf::parse(N5).unwrap(), settings, "6065:00=7B\nnothing", 0).unwrap_err();
    assert!(error.to_string().starts_with("line 2 of the store: \"nothing\" is not like"), "{error}");
}

#[test]
fn a_drive_stops_when_its_master_falls_silent() {
    let mut client = Client::new(EPOS4, settings());
    client.write(0x1016, 1, 0x7F_0064, 4).unwrap();
    client.write(0x605A, 0, 2, 2).unwrap();
    client.write(0x6060, 0, 1, 1).unwrap();
    client.send(0, &[1, 5]);
    client.wait_ms(500);
    client.enable();
    client.write(0x607A, 0, 1_000_000, 4).unwrap();
    client.write(0x6040, 0, 0x1F, 2).unwrap();
    (0..5).for_each(|_| {
        client.send(0x77F, &[5]);
        client.wait_ms(90);
    });
    assert_eq!(
        client.take("085"),
        [""; 0],
        "it hears its master, and before the first beat it watches nobody"
    );
    assert!(client.read(0x606C, 0).unwrap() > 0);
    client.wait_ms(12);
    assert_eq!(client.read(0x6041, 0).unwrap() & 0x6F, 0x07, "quick stop");
    client.wait_ms(500);
    assert_eq!(client.take("085"), ["085#3081110000000000"]);
    assert_eq!((client.read(0x6041, 0).unwrap() & 0x6F, client.read(0x606C, 0)), (0x40, Ok(0)));
    assert_eq!((client.read(0x1003, 0), client.read(0x1003, 1)), (Ok(1), Ok(0x8130)));
    client.write(0x1017, 0, 10, 2).unwrap();
    client.wait_ms(10);
    assert_eq!(client.take("705").last().unwrap(), "705#7F", "pre-operational");
}
