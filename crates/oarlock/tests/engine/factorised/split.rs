//! Where bodies fall apart.

use super::bodies::{chains, limb_of, walker};
use super::support::{body, model, plain, CHAIN, SCULLER};
use oarlock::body::Body;
use oarlock::estimate::FastSystem;

const ALL: [&str; 3] = ["gyro_bias", "accel_bias", "surge"];

fn names(body: &Body, states: &[usize]) -> Vec<String> {
    states.iter().map(|&s| body.layout.names[s].clone()).collect()
}

/// Every name says where it belongs, and every row goes with its sensor.
fn assert_as_named(text: &str, estimate: &[&str]) {
    let body = body(&model(text), &plain(estimate));
    let split = body.split();
    assert_eq!(split.limbs.len(), 2);
    for (k, states) in std::iter::once(&split.core).chain(&split.limbs).enumerate() {
        let odd: Vec<String> = names(&body, states).into_iter().filter(|name| limb_of(name) != k).collect();
        assert!(!states.is_empty() && odd.is_empty(), "part {k} holds {odd:?}");
    }
    for source in &body.suite.sources {
        let limb = source.rows.clone().find_map(|r| split.row_limbs[r]);
        assert_eq!(limb.map_or(0, |l| l + 1), limb_of(&source.name), "{}", source.name);
    }
}

#[test]
fn a_sculler_has_two_arms() {
    assert_as_named(SCULLER, &[]);
    assert_as_named(SCULLER, &ALL);
    assert_as_named(SCULLER, &["gyro_bias", "mounts"]);
}

#[test]
fn a_walker_has_two_legs_and_each_its_length() {
    assert_as_named(&walker(), &["gyro_bias", "accel_bias", "surge", "lengths"]);
}

/// The unit on the back feels where the right shoulder is, on whose frame it sits, so that is the core's; an upper arm's length is its arm's.
#[test]
fn lengths_go_with_those_who_feel_them() {
    let body = body(&model(SCULLER), &plain(&["lengths"]));
    let split = body.split();
    let place = |name: &str| {
        let state = body.layout.names.iter().position(|n| n == name).unwrap();
        split.limbs.iter().position(|limb| limb.contains(&state))
    };
    let found = ["l_cl_r", "l_cl_l", "l_ua_r", "l_fa_l"].map(|name| place(&format!("parameters.{name}")));
    assert_eq!(found, [None, Some(1), Some(0), Some(1)]);
}

/// An oar that is a state hangs on the root, but a hand holds it.
#[test]
fn a_loop_ties_an_oar_to_its_arm() {
    let text = SCULLER.replace("\ninput = true\n", "\n");
    assert_as_named(&text, &ALL);
    let body = body(&model(&text), &plain(&ALL));
    let right = names(&body, &body.split().limbs[0]);
    assert!(right.contains(&"r_oar_phi".to_string()) && right.contains(&"r_elbow_flexion".to_string()), "{right:?}");
}

/// Both hands on one oar: both arms are one limb with it, and the other oar is left to itself.
#[test]
fn hands_on_one_oar_make_one_limb() {
    let text = SCULLER.replace("\ninput = true\n", "\n").replace("frame_b = \"l_handle\"", "frame_b = \"r_handle\"");
    let body = body(&model(&text), &plain(&ALL));
    assert!(text.matches("r_handle").count() > 1);
    let split = body.split();
    let [arms, oar] = [0, 1].map(|k| names(&body, &split.limbs[k]));
    let both = ["r_hand_flexion", "l_hand_flexion", "r_oar_phi", "l_shoulder_flexion"];
    assert!(both.iter().all(|name| arms.contains(&name.to_string())), "{arms:?}");
    assert!(split.limbs.len() == 2 && oar.iter().all(|name| name.starts_with("l_oar")), "{oar:?}");
}

#[test]
fn a_chain_does_not_fall_apart() {
    let body = body(&model(CHAIN), &plain(&ALL[..2]));
    assert!(body.split().limbs.is_empty());
}

#[test]
fn chains_that_share_nothing_have_no_core() {
    let body = body(&model(&chains(&["r", "l"])), &plain(&ALL[..2]));
    let split = body.split();
    assert!(split.core.is_empty() && split.limbs.len() == 2, "{split:?}");
}
