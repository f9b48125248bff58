// What the mirror's place before the camera is worth: the omnidirectional arm experiments estimated
// with the place as stated and as it is, and the perspective one beside them:
//   vio_mirror_place DATASETS_FOLDER
// The paper's Table 8: vio-slam reproduce table8.
#include <cstdio>

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
        std::printf("omnidirectional arm %d, mirror's place as stated\n", k + 1);
        print_all(arm);
        std::printf("omnidirectional arm %d, mirror's place known\n", k + 1);
        print_all(test::Arm(arm, arm.true_rig()));
    }
    const test::Arm perspective(folder + "/perspective_arm.ini");
    std::printf("perspective arm\n");
    print_all(perspective);
    return 0;
} catch (const std::exception& error) {
    std::fprintf(stderr, "%s\n", error.what());
    return 1;
}
