#include "libvio/check/axes.h"

#include <algorithm>
#include <array>

namespace vio {

std::vector<Eigen::Matrix3d> signed_permutations(bool proper) {
    std::vector<Eigen::Matrix3d> all;
    std::array<int, 3> order{0, 1, 2};
    do {
        for (int signs = 0; signs < 8; ++signs) {
            Eigen::Matrix3d P = Eigen::Matrix3d::Zero();
            for (int row = 0; row < 3; ++row) P(row, order[row]) = (signs >> row) & 1 ? -1 : 1;
            if (!proper || P.determinant() > 0) all.push_back(P);
        }
    } while (std::next_permutation(order.begin(), order.end()));
    return all;
}

std::string axes_text(const Eigen::Matrix3d& P) {
    constexpr const char* kNames = "xyz";
    std::string text;
    for (int row = 0; row < 3; ++row) {
        int column = 0;
        P.row(row).cwiseAbs().maxCoeff(&column);
        if (row > 0) text += ", ";
        text +=
            std::string(1, kNames[row]) + " = " + (P(row, column) < 0 ? "-" : "") + kNames[column];
    }
    return text;
}

}  // namespace vio
