use super::*;
use proptest::prelude::*;
use std::f64::consts::PI;

const NAMES: [&str; 3] = ["l_ua_r", "inboard", "swivel"];
const VALUES: [f64; 3] = [0.315, 0.88, 0.04];

fn value(text: &str) -> f64 {
    Expr::parse(text, &NAMES).unwrap_or_else(|e| panic!("{text}: {e}")).eval(&VALUES)
}

fn mistake(text: &str) -> String {
    Expr::parse(text, &NAMES).expect_err(text)
}

#[test]
fn values() {
    assert_eq!(value("1"), 1.0);
    assert_eq!(value(" -pi / 2 "), -PI / 2.0);
    assert_eq!(value("-l_ua_r/2"), -0.1575);
    assert_eq!(value("inboard + 0.5*swivel"), 0.88 + 0.5 * 0.04);
    assert_eq!(value("2 - 3 - 4"), -5.0);
    assert_eq!(value("12/3/2*5"), 10.0);
    assert_eq!(value("-(1 + 2)*(3 - -1)"), -12.0);
    assert_eq!(value("--2 + +3"), 5.0);
    assert_eq!(value("1.5e-3 + 2E2 + .5 + 1."), 0.0015 + 200.0 + 0.5 + 1.0);
    assert_eq!(value("(((((l_ua_r)))))"), 0.315);
}

#[test]
fn a_text_without_parameters_is_a_constant() {
    assert_eq!(Expr::parse("60*pi/180", &NAMES), Ok(Expr::constant(60.0 * PI / 180.0)));
    let both = Expr::parse("swivel*inboard", &NAMES).expect("valid");
    assert_eq!(both.parameters().collect::<Vec<_>>(), [2, 1]);
}

#[test]
fn a_missing_parameter_is_not_a_number() {
    assert!(Expr::parse("swivel", &NAMES).expect("valid").eval(&VALUES[..2]).is_nan());
}

#[test]
fn messages_name_column_and_way_out() {
    let cases = [
        ("1 + l_ua", "column 5: unknown name `l_ua`; did you mean `l_ua_r`?"),
        ("inbord*2", "column 1: unknown name `inbord`; did you mean `inboard`?"),
        ("knee", "column 1: unknown name `knee`; valid: `l_ua_r`, `inboard`, `swivel`, `pi`"),
        ("0,52", "column 2: found `,`; decimals are written with a point"),
        ("90 deg", "column 4: `90` is followed by `deg`; angles are in rad"),
        ("90°", "column 3: angles are in rad"),
        ("0.5m", "column 4: `0.5` is followed by `m`; units are not written"),
        ("2pi", "column 2: `2` is followed by `pi`; a product needs `*`"),
        ("2**3", "column 3: powers are not supported"),
        ("2^3", "column 2: powers are not supported"),
        ("sin(1)", "column 1: `sin(`: there are no functions"),
        ("(1 + 2", "column 7: expected `)`"),
        ("1 + 2)", "column 6: `)` without `(`"),
        ("", "column 1: the expression ends early"),
        ("1 +", "column 4: the expression ends early"),
        ("1.2.3", "column 1: `1.2.3` is no number"),
        ("1e999", "column 1: `1e999` is too large"),
        ("ü + $", "column 1: unknown name `ü`"),
        ("1 + $", "column 5: found `$`"),
    ];
    for (text, wanted) in cases {
        let found = mistake(text);
        assert!(found.contains(wanted), "{text}: {found}");
    }
}

#[test]
fn deep_nesting_is_refused_and_long_sums_are_not() {
    assert!(mistake(&"(".repeat(10_000)).contains("nested"));
    assert!(mistake(&"1-(".repeat(10_000)).contains("nested"));
    assert_eq!(value(&format!("{}1", "-".repeat(10_000))), 1.0);
    assert_eq!(value(&format!("swivel{}", " + swivel".repeat(9_999))).round(), 400.0);
}

/// A random fully parenthesised expression, and its value by plain arithmetic.
fn expressions() -> impl Strategy<Value = (String, f64)> {
    let leaf = prop_oneof![
        (-1e3..1e3f64).prop_map(|x| (format!("({x:?})"), x)),
        Just(("pi".to_string(), PI)),
        (0usize..3).prop_map(|i| (NAMES[i].to_string(), VALUES[i])),
    ];
    leaf.prop_recursive(5, 40, 2, |inner| {
        (inner.clone(), inner, 0usize..5).prop_map(|((a, x), (b, y), op)| match op {
            0 => (format!("({a} + {b})"), x + y),
            1 => (format!("({a}-{b})"), x - y),
            2 => (format!("({a} * {b})"), x * y),
            3 => (format!("({a}/{b})"), x / y),
            _ => (format!("(-{a})"), -x),
        })
    })
}

proptest! {
    #[test]
    fn any_text_is_read_or_refused(text in any::<String>()) {
        if let Ok(expr) = Expr::parse(&text, &NAMES) {
            expr.eval(&VALUES);
        }
    }

    #[test]
    fn any_text_of_its_letters_is_read_or_refused(text in "[-+*/(). 0-9epi_l,°]{0,80}") {
        if let Ok(expr) = Expr::parse(&text, &NAMES) {
            expr.eval(&VALUES);
            expr.eval(&[]);
        }
    }

    #[test]
    fn values_agree_with_plain_arithmetic((text, wanted) in expressions()) {
        let found = value(&text);
        prop_assert!(found == wanted || (found.is_nan() && wanted.is_nan()), "{}: {} {}", text, found, wanted);
    }

    #[test]
    fn numbers_come_back_bit_for_bit(x in any::<f64>().prop_filter("finite", |x| x.is_finite())) {
        prop_assert_eq!(value(&format!("{x:?}")).to_bits(), x.to_bits());
    }
}
