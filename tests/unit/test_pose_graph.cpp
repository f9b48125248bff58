// Pose graphs come back from MRPT's own reader; motions between poses have the right Jacobian.
#include <gtest/gtest.h>

#include <filesystem>

#include "libvio/base/errors.h"
#include "libvio/geometry/relative_pose.h"
#include "libvio/io/mrpt_conversions.h"
#include "libvio/io/pose_graph.h"
#include "libvio/io/text.h"
#include "libvio/tracking/keyframes.h"
#include "tests/unit/numeric_jacobian.h"
#include "tests/unit/scratch_folder.h"

#ifdef VIO_HAVE_MRPT_GRAPHS
#include <mrpt/graphs/CNetworkOfPoses.h>
#endif

namespace vio {
namespace {

Estimate estimate_with_motions() {
    Estimate estimate;
    for (int i = 0; i < 6; ++i) {
        StateEstimate state;
        state.t = 1'403'636'584'763'555'584 + i * TimeNs{50'000'000};
        state.T_W_B = {so3::exp({0.3 * i, 0.2, -0.3 * i}), {1.0 / 3 * i, 2, -0.5}};
        estimate.states.push_back(state);
    }
    for (int i : {0, 2, 4}) {
        const int to = i == 4 ? 5 : i + 2;
        const Pose T = estimate.states[static_cast<size_t>(i)].T_W_B.inverse() *
                       estimate.states[static_cast<size_t>(to)].T_W_B;
        Matrix6d A = Matrix6d::Random();
        A.topRows<3>() *= 1e-3;  // rotations are known far better than positions
        estimate.keyframe_motions.push_back({estimate.states[static_cast<size_t>(i)].t,
                                             estimate.states[static_cast<size_t>(to)].t, T,
                                             A * A.transpose()});
    }
    return estimate;
}

TEST(RelativePose, HasTheJacobianOfSmallMoves) {
    const Pose A{so3::exp({0.3, -1.2, 0.8}), {1, -2, 3}}, B{so3::exp({-0.7, 0.1, 2.0}), {-2, 4, 1}};
    const RelativePose relative = relative_pose(A, B);
    EXPECT_LT((A * relative.T_A_B).boxminus(B).norm(), 1e-14);
    const auto J = test::numeric_jacobian<6, 12>([&](const Eigen::Matrix<double, 12, 1>& d) {
        return relative_pose(A.boxplus(d.head<6>()), B.boxplus(d.tail<6>()))
            .T_A_B.boxminus(relative.T_A_B);
    });
    EXPECT_LT((J - relative.J).cwiseAbs().maxCoeff(), 1e-7);
}

#ifdef VIO_HAVE_MRPT_GRAPHS
TEST(PoseGraph, IsReadByMrptWithEveryNumber) {
    const test::ScratchFolder folder;
    const Estimate estimate = estimate_with_motions();
    write_pose_graph(folder / "x.graph", estimate);
    mrpt::graphs::CNetworkOfPoses3DInf graph;
    graph.loadFromTextFile(folder / "x.graph");
    ASSERT_EQ(graph.nodes.size(), 4u);
    ASSERT_EQ(graph.edges.size(), 3u);
    EXPECT_EQ(graph.root, 0u);
    const std::vector<size_t> keyframes = {0, 2, 4, 5};
    for (size_t k = 0; k < 4; ++k)
        EXPECT_LT(from_mrpt(mrpt::poses::CPose3D(graph.nodes[k]))
                      .boxminus(estimate.states[keyframes[k]].T_W_B)
                      .norm(),
                  1e-14);
    for (size_t k = 0; k < 3; ++k) {
        const RelativeMotion& motion = estimate.keyframe_motions[k];
        ASSERT_TRUE(graph.edgeExists(k, k + 1));
        const auto& edge = graph.getEdge(k, k + 1);
        EXPECT_LT(from_mrpt(edge.mean).boxminus(motion.T_A_B).norm(), 1e-14);
        const Matrix6d J = mrpt_tangent_jacobian(motion.T_A_B);
        const Matrix6d information = (J * motion.covariance * J.transpose()).inverse();
        const Vector6d scale = information.diagonal().cwiseSqrt().cwiseInverse();
        for (int r = 0; r < 6; ++r)
            for (int c = 0; c < 6; ++c) {
                // MRPT 2.5.8 reads the terms between two angles into the triangle that it then
                // overwrites with the other, empty one.
                if (r >= 3 && c >= 3 && r != c) continue;
                EXPECT_NEAR(edge.cov_inv(r, c) * scale(r) * scale(c),
                            information(r, c) * scale(r) * scale(c), 1e-9);
            }
    }
}
#endif

// One motion without covariance costs its edge: the others stay, and what is left out is told.
TEST(PoseGraph, MotionWithoutInverseLeavesItsEdgeOut) {
    const test::ScratchFolder folder;
    Estimate estimate = estimate_with_motions();
    estimate.keyframe_motions[1].covariance.setZero();
    const auto rows_of = [](const std::string& file) {
        std::vector<std::string> found;
        TextRows rows(file);
        while (rows.next())
            found.push_back(std::string(rows.text(0)) +
                            (rows.text(0) == "EDGE3"
                                 ? " " + std::string(rows.text(1)) + " " + std::string(rows.text(2))
                                 : ""));
        return found;
    };
    const std::vector<std::string> expected = {"VERTEX3", "FIX",     "VERTEX3",  "EDGE3 0 1",
                                               "VERTEX3", "VERTEX3", "EDGE3 2 3"};
    PoseGraphWriter whole(folder / "whole.graph");
    whole.add(estimate);
    EXPECT_EQ(whole.left_out().count, 1);
    EXPECT_EQ(whole.left_out().from, estimate.states[2].t);
    EXPECT_EQ(whole.left_out().to, estimate.states[4].t);
    ASSERT_TRUE(whole.finish());
    EXPECT_EQ(rows_of(folder / "whole.graph"), expected);

    // State by state, as the filter gives them: the key-frame after the gap is no more at hand.
    PoseGraphWriter pieces(folder / "pieces.graph");
    for (const StateEstimate& state : estimate.states) {
        Estimate piece;
        piece.states = {state};
        for (const RelativeMotion& motion : estimate.keyframe_motions)
            if (motion.to == state.t) piece.keyframe_motions.push_back(motion);
        if (state.t == estimate.states[2].t)
            piece.states.insert(piece.states.begin(), estimate.states[0]);
        pieces.add(piece);
    }
    ASSERT_TRUE(pieces.finish());
    EXPECT_EQ(read_text(folder / "pieces.graph"), read_text(folder / "whole.graph"));

    for (RelativeMotion& motion : estimate.keyframe_motions) motion.covariance.setZero();
    PoseGraphWriter none(folder / "none.graph");
    none.add(estimate);
    EXPECT_EQ(none.left_out().count, 3);
    EXPECT_FALSE(none.finish());
    EXPECT_FALSE(std::filesystem::exists(folder / "none.graph"));
}

// Independent of MRPT's reader: the 21 numbers of an edge, angles in the order roll, pitch, yaw.
TEST(PoseGraph, EdgesHoldTheWholeInformationMatrix) {
    const test::ScratchFolder folder;
    const Estimate estimate = estimate_with_motions();
    write_pose_graph(folder / "x.graph", estimate);
    TextRows rows(folder / "x.graph");
    size_t edges = 0;
    while (rows.next()) {
        if (rows.text(0) != "EDGE3") continue;
        const RelativeMotion& motion = estimate.keyframe_motions[edges++];
        ASSERT_EQ(rows.size(), 30u);
        Matrix6d information;
        size_t field = 9;
        for (int r = 0; r < 6; ++r)
            for (int c = r; c < 6; ++c)
                information(r, c) = information(c, r) = rows.number(field++);
        Matrix6d J = mrpt_tangent_jacobian(motion.T_A_B);
        J.row(3).swap(J.row(5));
        // With the covariance in standard deviations, their product is the identity.
        const Matrix6d covariance = J * motion.covariance * J.transpose();
        const Vector6d sigma = covariance.diagonal().cwiseSqrt();
        const Matrix6d product =
            sigma.asDiagonal() * information * covariance * sigma.cwiseInverse().asDiagonal();
        EXPECT_LT((product - Matrix6d::Identity()).cwiseAbs().maxCoeff(), 1e-8);
    }
    EXPECT_EQ(edges, 3u);
}

TEST(PoseGraph, IsTheSameWhenItComesInPieces) {
    const test::ScratchFolder folder;
    const Estimate whole = estimate_with_motions();
    write_pose_graph(folder / "whole.graph", whole);
    PoseGraphWriter writer(folder / "pieces.graph");
    for (const StateEstimate& state : whole.states) {
        Estimate piece;
        piece.states = {state};
        if (state.t == whole.states[0].t) continue;
        if (state.t == whole.states[2].t) piece.states.assign(&whole.states[0], &state + 1);
        for (const RelativeMotion& motion : whole.keyframe_motions)
            if (motion.to == state.t && motion.to != whole.states.back().t)
                piece.keyframe_motions.push_back(motion);
        writer.add(piece);
    }
    Estimate end;  // the last motion may come after its state
    end.keyframe_motions = {whole.keyframe_motions.back()};
    writer.add(end);
    EXPECT_FALSE(std::filesystem::exists(folder / "pieces.graph"));
    EXPECT_TRUE(writer.finish());
    EXPECT_EQ(read_text(folder / "pieces.graph"), read_text(folder / "whole.graph"));
}

TEST(PoseGraph, NeedsCovariances) {
    const test::ScratchFolder folder;
    Estimate estimate = estimate_with_motions();
    for (RelativeMotion& motion : estimate.keyframe_motions) motion.covariance.setZero();
    EXPECT_THROW(write_pose_graph(folder / "x.graph", estimate), InputError);
    EXPECT_THROW(write_pose_graph(folder / "x.graph", {}), InputError);
    EXPECT_TRUE(std::filesystem::is_empty(folder.path()));
}

TEST(Keyframes, AreTheFirstTheLastAndWhereTheViewHasChanged) {
    std::vector<FeatureFrame> frames;
    for (int i = 0; i < 10; ++i) {
        FeatureFrame frame{i, {}};
        for (int k = 0; k < 10; ++k)
            frame.features.push_back({i + k, {0, 0}, Eigen::Matrix2d::Identity()});
        frames.push_back(frame);
    }
    // 5 is the first with fewer than six of ten in common.
    EXPECT_EQ(select_keyframes(frames, 0.6), (std::vector<int>{0, 5, 9}));
}

}  // namespace
}  // namespace vio
