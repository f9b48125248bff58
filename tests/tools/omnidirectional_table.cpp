// Prints the layout of the paper's Table 8 for the simulated omnidirectional arm experiments, and
// for the perspective one beside them: vio_omnidirectional_table DATASETS_FOLDER
#include <cmath>
#include <cstdio>

#include "tests/omnidirectional_arm.h"

namespace {

using namespace vio;

struct PaperRow {
    const char* estimate;
    double rotation, rotation_max, position_cm, position_max_cm, scale_percent;
};

// Table 8 of Strelow and Singh (2004); the first rows are batch and image-only.
const PaperRow kPaper[3][7] = {{{"batch", 0.12, 0.15, 3.4, 4.5, 5.2},
                                {"batch, image-only", 0.12, 0.15, 5.1, 7.5, NAN},
                                {"recursive, 20 images", 0.14, 0.18, 7.4, 12.3, -33.8},
                                {"recursive, 30 images", 0.12, 0.15, 7.5, 14.2, -48.9},
                                {"recursive, 40 images", 0.12, 0.20, 9.6, 15.6, -6.1},
                                {"recursive, 50 images", 0.11, 0.15, 6.4, 9.2, -5.8},
                                {"recursive, 60 images", 0.11, 0.15, 6.1, 8.1, 2.8}},
                               {{"batch", 0.11, 0.13, 4.1, 6.3, 6.7},
                                {"batch, image-only", 0.10, 0.12, 4.0, 6.1, NAN},
                                {"recursive, 20 images", 0.14, 0.22, 6.2, 9.5, 113.5},
                                {"recursive, 30 images", 0.14, 0.18, 4.7, 7.0, -11.6},
                                {"recursive, 40 images", 0.13, 0.17, 4.1, 5.2, -13.3},
                                {"recursive, 50 images", 0.13, 0.17, 3.9, 5.2, -9.2},
                                {"recursive, 60 images", 0.11, 0.15, 3.9, 4.9, 8.5}},
                               {{"batch", 0.11, 0.14, 4.0, 5.9, 8.0},
                                {"batch, image-only", 0.11, 0.14, 4.0, 5.9, NAN},
                                {"recursive, 20 images", 0.15, 0.20, 4.9, 8.3, 41.5},
                                {"recursive, 30 images", 0.15, 0.19, 4.6, 7.1, -14.6},
                                {"recursive, 40 images", 0.14, 0.17, 4.3, 5.5, -13.9},
                                {"recursive, 50 images", 0.14, 0.17, 4.2, 5.4, -10.5},
                                {"recursive, 60 images", 0.12, 0.15, 4.0, 4.8, 9.4}}};

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

void print(const char* name, const PaperRow& row, const test::ArmErrors& e) {
    print(name, e);
    std::printf("  %-34s %5.2f  / %5.2f   %5.1f / %5.1f   ", "    paper", row.rotation,
                row.rotation_max, row.position_cm, row.position_max_cm);
    if (std::isnan(row.scale_percent))
        std::printf("   N/A\n");
    else
        std::printf("%+6.1f %%\n", row.scale_percent);
}

}  // namespace

int main(int argc, char** argv) try {
    if (argc != 2) {
        std::fprintf(stderr, "usage: %s DATASETS_FOLDER\n", argv[0]);
        return 2;
    }
    const std::string folder = argv[1];
    std::printf("average / maximum: rotation [rad], position [cm], scale error\n");
    for (int k = 0; k < 3; ++k) {
        const test::Arm arm(folder + "/omnidirectional_arm_" + std::to_string(k + 1) + ".ini");
        std::printf("omnidirectional arm %d\n", k + 1);
        const BatchResult batch = arm.batch(true);
        print(kPaper[k][0].estimate, kPaper[k][0], arm.errors(batch.estimate));
        print(kPaper[k][1].estimate, kPaper[k][1],
              arm.errors(arm.batch(false, batch.estimate).estimate));
        for (int i = 0; i < 5; ++i)
            print(kPaper[k][2 + i].estimate, kPaper[k][2 + i],
                  arm.errors(arm.recursive(20 + 10 * i)));
        const test::Arm exact(arm, arm.true_rig());
        const BatchResult with_exact = exact.batch(true);
        print("batch, mirror's place known", exact.errors(with_exact.estimate));
        print("image-only, mirror's place known",
              exact.errors(exact.batch(false, with_exact.estimate).estimate));
        print("recursive, 60 images, likewise", exact.errors(exact.recursive(60)));
    }
    const test::Arm perspective(folder + "/perspective_arm.ini");
    std::printf("perspective arm\n");
    const BatchResult batch = perspective.batch(true);
    print("batch", perspective.errors(batch.estimate));
    print("batch, image-only",
          perspective.errors(perspective.batch(false, batch.estimate).estimate));
    return 0;
} catch (const std::exception& error) {
    std::fprintf(stderr, "%s\n", error.what());
    return 1;
}
