use super::*;

const HEAD: &str = "ParameterName=Some\nObjectType=0x7\nAccessType=rw\n";

/// The entry 2000h:00h with these lines.
fn read(lines: &str) -> Result<Entry, DcfError> {
    let dcf = Dcf::parse(&format!("[2000]\n{HEAD}{lines}"))?;
    Ok(dcf.entry(ObjectAddress::new(0x2000, 0)).unwrap().clone())
}

#[test]
fn numbers_are_decimal_hexadecimal_octal_or_follow_from_the_node() {
    let table = [
        ("4", "-12", Value::Number(-12)),
        ("7", "0x1F", Value::Number(31)),
        ("7", "0X1f", Value::Number(31)),
        ("7", "017", Value::Number(15)),
        ("7", "0", Value::Number(0)),
        ("7", "$NODEID+0x180", Value::OfNode(0x180)),
        ("7", "0x80000200 + $NodeId", Value::OfNode(0x8000_0200)),
        ("7", "$NODEID", Value::OfNode(0)),
        ("4", "0x80000000", Value::Number(i32::MIN.into())),
        ("2", "0xFD", Value::Number(-3)),
        ("0x1B", "0xFFFFFFFFFFFFFFFF", Value::Number(u64::MAX.into())),
        ("8", "2.5", Value::Real(2.5)),
        ("9", "017", Value::Text("017".to_owned())),
    ];
    for (data_type, text, expected) in table {
        let entry = read(&format!("DataType={data_type}\nDefaultValue={text}")).unwrap();
        assert_eq!(entry.default, Some(expected), "{text}");
    }
}

#[test]
fn what_cannot_be_read_is_refused_with_its_line_and_a_remedy() {
    let table = [
        ("DataType=7\nDefaultValue=08", 6, "DefaultValue=08 is no number; write decimal, 0x hexadecimal,"),
        ("DataType=7\nDefaultValue=0x", 6, "DefaultValue=0x is no number"),
        ("DataType=7\nHighLimit=+-1", 6, "HighLimit=+-1 is no number"),
        ("DataType=7\nHighLimit=$NODEID-1", 6, "HighLimit=$NODEID-1 is no number"),
        ("DataType=5\nHighLimit=256", 6, "HighLimit=256 is not within 0 to 255"),
        ("DataType=7\nLowLimit=-1", 6, "LowLimit=-1 is not within 0 to 4294967295"),
        ("DataType=0x10000", 5, "DataType=0x10000 is not within 0 to 65535"),
        ("DataType=7\nPDOMapping=2", 6, "PDOMapping=2 is not within 0 to 1"),
        ("LowLimit=0", 1, "[2000] has no DataType; add it"),
        ("DataType=7\n\nno value", 7, "\"no value\" is neither [section] nor key=value"),
        ("DataType=7\ndatatype=7", 6, "datatype occurs twice in its section, first in line 5"),
        ("DataType=7\n[2000]", 6, "[2000] occurs twice, first in line 1"),
        ("DataType=7\n[2001sub0]", 6, "[2001sub0] has no section [2001] of its object; add it"),
        ("DataType=7\n[0x2001]\nDataType=7", 6, "[0x2001] is the name of no entry; name an entry by four"),
        ("DataType=7\n[2000sub1h]\nParameterValue=7", 6, "[2000sub1h] is the name of no entry"),
        ("DataType=7\n[2001]\nObjectType=3", 6, "ObjectType=0x3 is not one of 2 (domain)"),
    ];
    for (lines, line, message) in table {
        let error = read(lines).unwrap_err();
        assert_eq!(error.line, line, "{error}");
        assert!(error.to_string().starts_with(&format!("line {line}: {message}")), "{error}");
    }
    let access = Dcf::parse("[2000]\nParameterName=Some\nDataType=7\nAccessType=any").unwrap_err();
    assert_eq!(access.to_string(), "line 4: AccessType=any is not one of ro, wo, rw, rwr, rww, const");
    let outside = Dcf::parse("; comment\nKey=1").unwrap_err();
    assert_eq!(outside.to_string(), "line 2: Key is before the first [section]");
}

#[test]
fn entries_come_in_the_order_of_addresses_whatever_the_order_of_sections() {
    let var = |name: &str| format!("[{name}]\n{HEAD}DataType=7\n");
    let text = [
        var("6040"),
        "[1018]\nParameterName=Identity\nObjectType=9\nSubNumber=2\n".to_owned(),
        var("1018sub10"),
        var("1018SUB1"),
        var("1000"),
        "[Comments]\nLines=0\n".to_owned(),
    ]
    .concat();
    let dcf = Dcf::parse(&text).unwrap();
    let addresses: Vec<_> = dcf.entries().map(|entry| entry.address.to_string()).collect();
    assert_eq!(addresses, ["1000h:00h", "1018h:01h", "1018h:10h", "6040h:00h"]);
}

#[test]
fn a_compact_array_has_all_its_entries() {
    let text = "[1003]\nParameterName=Errors\nObjectType=8\nDataType=7\nAccessType=ro\nDefaultValue=9\nCompactSubObj=2\n\
                [1003Name]\nNrOfEntries=1\n2=Older\n[1003Value]\nNrOfEntries=1\n1=0x10\n";
    let dcf = Dcf::parse(text).unwrap();
    let entry = |subindex| dcf.entry(ObjectAddress::new(0x1003, subindex)).unwrap();
    let read = [0, 1, 2].map(|subindex| (entry(subindex).name.as_str(), entry(subindex).value().cloned()));
    let expected = [("Highest sub-index supported", 2), ("Errors1", 0x10), ("Older", 9)];
    assert_eq!(read, expected.map(|(name, number)| (name, Some(Value::Number(number)))));
    let given = [0, 1, 2].map(|subindex| entry(subindex).parameter.is_some());
    assert_eq!(given, [false, true, false], "values of the file are no values as delivered");
    assert_eq!(entry(1).default, Some(Value::Number(9)));
}

#[test]
fn a_configuration_says_for_which_node_and_bit_rate_it_is() {
    let read = |text: &str| Dcf::parse(text).map(|dcf| dcf.commissioning);
    let named = |node_id, baudrate_kbit_s| Ok(Commissioning { node_id, baudrate_kbit_s });
    assert_eq!(read("[DeviceComissioning]\nNodeID=0x04\nBaudrate=500\n"), named(Some(4), Some(500)));
    assert_eq!(read("[DEVICECommissioning]\nnodeid=4\nBaudrate=\n"), named(Some(4), None));
    assert_eq!(read("[DeviceComissioning]\nNodeID=0\nNodeName=x\n"), named(None, None));
    assert_eq!(read("[FileInfo]\nNodeID=4\n"), named(None, None));
    assert_eq!(read("[DeviceComissioning]\nNodeID=four\n").unwrap_err().line, 2);
}

#[test]
fn a_data_type_has_its_name_of_cia_301() {
    let names = [(1, "BOOLEAN"), (2, "INTEGER8"), (7, "UNSIGNED32"), (8, "REAL32"), (9, "VISIBLE_STRING")];
    let more = [(0xC, "TIME_OF_DAY"), (0x10, "INTEGER24"), (0x11, "REAL64"), (0x15, "INTEGER64")];
    let last = [(0x16, "UNSIGNED24"), (0x1B, "UNSIGNED64"), (0x40, "data type 0040h")];
    for (index, name) in names.into_iter().chain(more).chain(last) {
        assert_eq!(DataType(index).to_string(), name);
    }
}

#[test]
fn a_configuration_takes_the_place_of_the_value_as_delivered() {
    let entry = read("DataType=7\nDefaultValue=1\nParameterValue=\nLowLimit=\n").unwrap();
    assert_eq!((entry.value(), entry.lowest.clone()), (Some(&Value::Number(1)), None), "empty is absent");
    let entry = read("DataType=7\nDefaultValue=1\nParameterValue=2\nLowLimit=0x1\nHighLimit=3").unwrap();
    assert_eq!(entry.value(), Some(&Value::Number(2)));
    assert_eq!([entry.lowest, entry.highest], [1, 3].map(|number| Some(Value::Number(number))));
}

#[test]
fn objects_of_modules_are_told_and_are_no_entries() {
    let sections = ["M1Comments", "M1SubExt6200", "M12Fixed6423", "M12Fixed6423sub1", "M1SubExt6200Name"];
    let text = sections.map(|name| format!("[{name}]\n{HEAD}DataType=7\n")).concat();
    let dcf = Dcf::parse(&text).unwrap();
    assert_eq!((dcf.of_modules, dcf.undescribed, dcf.entries.len()), (vec![0x6200, 0x6423], vec![], 0));
}

#[test]
fn objects_that_a_list_names_without_a_section_are_told() {
    let lists = "[MandatoryObjects]\nSupportedObjects=1\n1=0x1000\n[OptionalObjects]\nSupportedObjects=2\n1=0x2000\n2=0x2001\n";
    let dcf = Dcf::parse(&format!("{lists}[2000]\n{HEAD}DataType=7")).unwrap();
    assert_eq!(dcf.undescribed, [0x1000, 0x2001]);
    assert!(Dcf::parse("[OptionalObjects]\n1=all").is_err());
}

const TEN_MB: usize = 10_000_000;

#[test]
fn a_description_of_ten_megabytes_is_read_whole() {
    let name = "A name that a vendor may give an object of a device".repeat(2);
    let object = |index: u16| {
        format!("[{index:04X}]\nParameterName={name}\nDataType=7\nAccessType=rw\nDefaultValue={index}\n")
    };
    let text: String = (0x1000..=u16::MAX).map(object).collect();
    assert!(text.len() > TEN_MB, "{}", text.len());
    let dcf = Dcf::parse(&text).unwrap();
    assert_eq!(dcf.entries().len(), 0xF000);
    assert!(dcf.entries().all(|entry| entry.value() == Some(&Value::Number(entry.address.index.into()))));
}

/// Without a limit, 10 MB of text become 6 GB of entries.
#[test]
fn ten_megabytes_that_describe_more_than_fits_into_memory_are_refused_with_their_line() {
    let compact = |index: u16, name: &str| {
        format!(
            "[{index:04X}]\nParameterName={name}\nObjectType=8\nDataType=7\nAccessType=rw\nCompactSubObj=254\n"
        )
    };
    let arrays: String = (0x1000..=u16::MAX).map(|index| compact(index, &"n".repeat(90))).collect();
    assert!(arrays.len() > TEN_MB, "{}", arrays.len());
    let error = Dcf::parse(&arrays).unwrap_err();
    assert!(
        error.problem.starts_with("the description needs more than 64 MiB with its compact arrays"),
        "{error}"
    );
    let five_hundred: String = (0x1000..0x1000 + 500).map(|index| compact(index, "Array")).collect();
    assert_eq!(Dcf::parse(&five_hundred).unwrap().entries().len(), 500 * 255);

    for text in
        ["n".repeat(TEN_MB), compact(0x1000, &"n".repeat(TEN_MB)), format!("[{}]", "n".repeat(TEN_MB))]
    {
        let error = Dcf::parse(&text).unwrap_err();
        assert!(
            error.problem.ends_with("at most 65536 are possible, so shorten the line"),
            "line {}",
            error.line
        );
    }
}
