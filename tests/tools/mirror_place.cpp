// What the mirror's place before the camera is worth: the omnidirectional arm experiments estimated
// with the place as stated and as it is, and the perspective one beside them:
//   vio_mirror_place DATASETS_FOLDER | calibration
// The paper's Table 8: vio-slam reproduce table8. Then the calibration of that place, over seeds.
#include <cstdio>

#include "libvio/base/angles.h"
#include "libvio/calibration/board_detector.h"
#include "tests/mirror_board.h"
#include "tests/omnidirectional_arm.h"

namespace {

using namespace vio;

void print(const char* name, const test::ArmErrors& e) {
    std::printf("  %-34s %5.3f / %5.3f  %5.2f / %5.2f  ", name, e.rotation, e.rotation_max,
                100 * e.position, 100 * e.position_max);
    if (e.scale)
        std::printf("%+6.1f %%", 100 * *e.scale);
    else
        std::printf("%8s", "N/A");
    if (!e.complete) std::printf("  lost track");
    std::printf("\n");
}

void print_all(const test::Arm& arm) {
    const BatchResult batch = arm.batch(true);
    print("batch", arm.errors(batch.estimate));
    print("batch, image-only", arm.errors(arm.batch(false, batch.estimate).estimate));
    print("recursive, 60 images", arm.errors(arm.recursive(60)));
}

// One image of targets all around, 0.5 to 2.5 m away, seen with 1 px noise; the mirror off by half
// a degree and a millimetre. Bars: 0.1 degrees and 1 mm in 95 % of 100 seeds. The Cramer-Rao bound
// falls with the root of the number of targets: for 0.1 degrees in 95 % (0.041 degrees per axis) it
// asks for 1600 where the camera's pose is known, and 2200 where it is found; over seeds, below,
// the latter takes somewhat more than 2500.
void calibrate_over_seeds(int targets, bool pose_known) {
    constexpr int kSeeds = 100;
    int turned = 0, placed = 0;
    double nees = 0;
    for (int seed = 1; seed <= kSeeds; ++seed) {
        const test::MirrorShot shot =
            test::mirror_shot(static_cast<std::uint64_t>(seed), targets, 1);
        MirrorCalibrationOptions options;
        options.sigma_px = 1;
        if (pose_known) options.T_G_C = shot.T_G_C;
        const test::MirrorErrors errors = test::mirror_errors(shot.T_C_M, shot.calibrate(options));
        turned += errors.rotation < 0.1 * kDegree;
        placed += errors.position < 1e-3;
        nees += errors.nees / kSeeds;
    }
    std::printf(
        "  %4d targets, camera's pose %-7s within 0.1 deg %3d %%, 1 mm %3d %%, NEES %.2f of 5\n",
        targets, pose_known ? "known:" : "found:", turned, placed, nees);
}

// An AprilGrid held before the mirror, found in rendered images, by the number of images.
void calibrate_from_boards() {
    if (!BoardDetector::knows_april_grids()) return;
    constexpr int kSeeds = 10;
    const std::vector<size_t> counts{1, 2, 4, 8};
    struct Sum {
        int corners = 0, turned = 0, placed = 0;
        double rms_px = 0, nees = 0;
    };
    std::vector<Sum> sums(counts.size());
    for (std::uint64_t seed = 1; seed <= kSeeds; ++seed) {
        test::MirrorBoard board(seed);
        const BoardDetector detector(board.board(), test::mirror_camera());
        std::vector<FeatureFrame> frames;
        for (size_t k = 0; k < counts.size(); ++k) {
            while (frames.size() < counts[k])
                if (FeatureFrame frame{0, detector.detect(board.shoot().image)};
                    frame.features.size() >= 24)
                    frames.push_back(frame);
            const auto found =
                calibrate_mirror(*test::mirror_camera(), frames, board.board().points);
            const test::MirrorErrors errors = test::mirror_errors(board.T_C_M(), found);
            sums[k].corners += static_cast<int>(found.residuals.size());
            sums[k].turned += errors.rotation < 0.1 * kDegree;
            sums[k].placed += errors.position < 1e-3;
            sums[k].rms_px += found.rms_px / kSeeds;
            sums[k].nees += errors.nees / kSeeds;
        }
    }
    for (size_t k = 0; k < counts.size(); ++k)
        std::printf(
            "  AprilGrid in %zu images, %3d corners, residual %.3f px: within 0.1 deg %d, 1 mm %d "
            "of %d, NEES %.2f of 5\n",
            counts[k], sums[k].corners / kSeeds, sums[k].rms_px, sums[k].turned, sums[k].placed,
            kSeeds, sums[k].nees);
}

void compare_arms(const std::string& folder) {
    std::printf("average / maximum: rotation [rad], position [cm], scale error\n");
    for (int k = 0; k < 3; ++k) {
        const test::Arm arm(folder + "/omnidirectional_arm_" + std::to_string(k + 1) + ".ini");
        std::printf("omnidirectional arm %d, mirror's place as stated\n", k + 1);
        print_all(arm);
        std::printf("omnidirectional arm %d, mirror's place known\n", k + 1);
        print_all(test::Arm(arm, arm.true_rig()));
    }
    const test::Arm perspective(folder + "/perspective_arm.ini");
    std::printf("perspective arm\n");
    print_all(perspective);
}

}  // namespace

int main(int argc, char** argv) try {
    if (argc != 2) {
        std::fprintf(stderr, "usage: %s DATASETS_FOLDER | calibration\n", argv[0]);
        return 2;
    }
    if (argv[1] != std::string("calibration")) compare_arms(argv[1]);
    std::printf("calibration of the mirror's place from one image, 1 px noise\n");
    for (const int targets : {300, 1000, 1600, 2500})
        for (const bool pose_known : {true, false}) calibrate_over_seeds(targets, pose_known);
    std::printf("calibration of the mirror's place from rendered images of a board\n");
    calibrate_from_boards();
    return 0;
} catch (const std::exception& error) {
    std::fprintf(stderr, "%s\n", error.what());
    return 1;
}
