// Pictures look as they did.
#include <cmath>

#include "gui_offscreen/framing.h"
#include "gui_offscreen/scene.h"
#include "tests/golden/pictures.h"
#include "tests/wanting.h"

namespace vio::test {
namespace {

/// A figure of eight before a wall, with a lost stretch; the same on every machine.
Estimate eight() {
    Estimate estimate;
    estimate.g_W = {0, 0, -9.81};
    for (int i = 0; i < 200; ++i) {
        const double a = 2 * M_PI * i / 200;
        StateEstimate state;
        state.t = i * TimeNs{50'000'000};
        state.T_W_B = {look_along({std::cos(a), std::cos(2 * a), 0}),
                       {2 * std::sin(a), 1.5 * std::sin(2 * a), 0.3 * std::cos(a)}};
        state.covariance = 1e-3 * Matrix15d::Identity();
        state.lost = i > 100 && i < 120;
        estimate.states.push_back(state);
    }
    for (int i = 0; i < 400; ++i) {
        const double u = std::fmod(0.618034 * i, 1.0), v = std::fmod(0.754878 * i, 1.0);
        LandmarkEstimate landmark;
        landmark.id = i;
        landmark.p_W = {6 * u - 3, 2, 3 * v - 1.5};
        landmark.covariance = (1e-4 + 1e-3 * u) * Eigen::Matrix3d::Identity();
        estimate.landmarks.push_back(landmark);
    }
    return estimate;
}

std::vector<NamedPath> truth(const Estimate& estimate) {
    NamedPath path{"truth", {}};
    for (const StateEstimate& state : estimate.states) path.poses.push_back({state.t, state.T_W_B});
    for (TimedPose& row : path.poses) row.T_W_B.p += Eigen::Vector3d(0.1, 0.05, 0);
    return {path};
}

struct Case {
    const char* name;
    View view;
    bool dark;
};
const Case kCases[] = {{"iso", View::kIso, false},
                       {"iso_dark", View::kIso, true},
                       {"top", View::kTop, false},
                       {"side_dark", View::kSide, true},
                       {"chase", View::kChase, false}};

Snapshot drawn(const Case& c, const Estimate& estimate, double turn = 0) {
    SceneOptions scene;
    scene.dark = c.dark;
    SnapshotOptions picture;
    picture.width = 640;
    picture.height = 360;
    picture.view = c.view;
    picture.turn = turn;
    return render_snapshot(build_scene(estimate, scene, truth(eight())), picture);
}

TEST(Pictures, LookAsStored) {
    for (const Case& c : kCases) {
        const Snapshot snapshot = drawn(c, eight());
        VIO_SKIP_FOR(snapshot.problem);
        expect_as_stored(snapshot.image, c.name);
    }
}

// What the comparison must and must not notice.
TEST(Pictures, TheComparisonSeesWhatAnEyeSees) {
    const Snapshot whole = drawn(kCases[0], eight());
    VIO_SKIP_FOR(whole.problem);
    const auto difference = [&](const Estimate& other, double turn = 0) {
        return visible_difference(whole.image, drawn(kCases[0], other, turn).image);
    };
    Estimate found = eight(), bare = eight(), upright = eight();
    for (StateEstimate& state : found.states) state.lost = false;
    bare.landmarks.clear();
    upright.g_W.setZero();
    EXPECT_GT(difference(found), kAlike) << "the lost stretch";
    EXPECT_GT(difference(bare), kAlike) << "the landmarks";
    EXPECT_GT(difference(upright), kAlike) << "gravity's arrow";
    EXPECT_GT(difference(eight(), 0.03), kAlike) << "a view turned by two degrees";

    // A driver's rounding: a level of grey here and there, corners snapped to sixteenths of a
    // pixel.
    cv::Mat noise(whole.image.size(), CV_8UC3), shifted;
    cv::theRNG().state = 1;
    cv::randu(noise, 0, 2);
    const cv::Mat move = (cv::Mat_<double>(2, 3) << 1, 0, 1.0 / 16, 0, 1, 1.0 / 16);
    cv::warpAffine(whole.image + noise, shifted, move, whole.image.size(), cv::INTER_LINEAR,
                   cv::BORDER_REPLICATE);
    EXPECT_LE(visible_difference(whole.image, shifted), kAlike);
}

}  // namespace
}  // namespace vio::test
