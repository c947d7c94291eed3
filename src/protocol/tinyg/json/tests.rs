use super::*;

#[test]
fn accepts_what_senders_write() {
    for line in [
        "{}",
        "{fb:n}",
        " { \"xvm\" : 1200 } ",
        "{x:{vm:1000,fr:n},y:{vm:\"\"}}",
        "{sr:{}}",
        "{sr:{posx:t,posy:true},qr:NULL}",
        "{\"gc\":\"g0 (a \\\"b\\\")\"}",
        "{xvm:-1.5e-3}",
        "{xvm:0800}",
        "{x:{},y:n}",
    ] {
        assert_eq!(check(line.as_bytes()), Ok(()), "{line}");
    }
}

#[test]
fn refuses_the_rest() {
    for line in [
        "",
        "{",
        "{xvm",
        "{xvm:",
        "{\"xvm\":}",
        "{xvm:n",
        "{xvm:n,}",
        "{xvm:n}}",
        "{xvm:n} x",
        "{xvm:+1}",
        "{xvm:.5}",
        "{xvm:5.}",
        "{xvm:1e}",
        "{xvm:[1]}",
        "{:n}",
        "{\"\":n}",
        "{a:{b:n}c:n}",
        "{,a:n}",
        "{a:\"b}",
        "{a:\"b\\",
        "{xvm:0000000000000000000000001}",
        "{abcdefghijklmnopqrstuvwxyz0123456:n}",
        "x{}",
    ] {
        assert_eq!(check(line.as_bytes()), Err(Status::JsonSyntax), "{line}");
    }
    for line in ["{a:{b:{c:n}}}", "{a:{b:{"] {
        assert_eq!(check(line.as_bytes()), Err(Status::JsonTooDeep), "{line}");
    }
}

#[test]
fn a_line_may_fill_the_index() {
    let mut line = std::vec![b' '; 255];
    line[..6].copy_from_slice(b"{fb:n}");
    assert!(check(&line).is_ok());
    line[254] = b'}';
    assert!(check(&line).is_err());
    line[5] = b' ';
    assert!(check(&line).is_ok());
}

#[test]
fn finds_pairs_of_the_outer_object() {
    let at = |line: &str, name: &str| {
        find(line.as_bytes(), |n| n == name.as_bytes()).map(|pair| pair.name.start)
    };
    assert_eq!(at("{a:1,b:{c:n},c:2}", "c"), Some(13));
    assert_eq!(at("{a:{},b:n}", "b"), Some(6));
    assert_eq!(at("{a:{b:n}}", "b"), None);
    assert_eq!(at("{}", "b"), None);
}

#[test]
fn reads_pairs_in_turn() {
    let line = b"{ a:1 , \"b\":{c:t}, d:\"x\\\"y\" }";
    let read = |at| pair(line, at).map(|p| (p.name.of(line), p.kind, p.value.of(line), p.next));
    let first = read(2).unwrap();
    assert_eq!((first.0, first.1, first.2), (&b"a"[..], Kind::Number, &b"1"[..]));
    let second = read(first.3).unwrap();
    assert_eq!((second.0, second.1), (&b"b"[..], Kind::Object));
    let inner = read(second.3).unwrap();
    assert_eq!((inner.0, inner.1), (&b"c"[..], Kind::True));
    assert_eq!(read(inner.3), None);
    let last = read(behind_object(line, inner.3)).unwrap();
    assert_eq!((last.0, last.1, last.2), (&b"d"[..], Kind::Text, &b"x\\\"y"[..]));
    assert_eq!(read(last.3), None);
}
