// In which order the unknowns of a symmetric block-sparse matrix are eliminated, and which dense
// fronts this makes (multifrontal method; Duff and Reid 1983, Liu 1992).
#pragma once

#include <vector>

namespace vio::batch {

/// What couples the block rows of a matrix, beside its own non-zero blocks: row sets that are
/// coupled completely. Set k: blocks[first[k]] ... blocks[first[k + 1] - 1].
struct BlockSets {
    std::vector<int> first{0};
    std::vector<int> blocks;
    std::vector<int> terms;  ///< of each set: where its members' terms begin (BlockCholesky)

    int count() const { return static_cast<int>(first.size()) - 1; }
};

/// Place in the order of elimination. The two halves do not touch each other, so that each can be
/// eliminated by a thread of its own.
enum class Part : int { first_half, second_half, between, last };

/// A dense part of the factorisation: its pivots are eliminated, which changes its other rows.
struct Front {
    std::vector<int> blocks;  ///< block rows in order of elimination, hence pivots first
    std::vector<int> starts;  ///< row of each block in the front
    int pivot_blocks = 0;
    int pivots = 0;                ///< scalar columns that are eliminated here
    int size = 0;                  ///< scalar rows
    int parent = -1;               ///< front that takes up what is left; -1: none
    Part part = Part::first_half;  ///< between: waits for both halves

    /// Rows beyond the pivots, piece by piece, in the parent.
    struct Run {
        int from, to, length;
    };
    std::vector<Run> runs;
    long panel = 0;   ///< where its columns stand in the factor's values
    long update = 0;  ///< where its remainder stands in the working memory of its part

    int rest() const { return size - pivots; }
    /// Row of a block; the block must be in the front.
    int row_of(int block, const std::vector<int>& order) const;
};

/// Order and fronts of a factorisation; depends on the pattern of the matrix alone.
struct EliminationPlan {
    std::vector<int> order;     ///< of each block: when it is eliminated
    std::vector<int> front_of;  ///< of each block: where it is eliminated
    std::vector<Front> fronts;  ///< children before parents; halves first
    std::vector<int> offsets;   ///< first scalar index of each block, and the size
    long values = 0;            ///< numbers in the factor
    long working[3] = {};  ///< numbers in the working memory of each half and of what is between

    double operations() const;  ///< of a factorisation, additions and multiplications
    int size() const { return offsets.back(); }
};

/// dims: size of each block row; pairs: (row, col) of blocks off the diagonal. The order is by
/// approximate minimum degree within each part, `between` after both halves, `last` behind all.
EliminationPlan plan_elimination(const std::vector<int>& dims,
                                 const std::vector<std::pair<int, int>>& pairs,
                                 const BlockSets& sets, const std::vector<Part>& parts);

}  // namespace vio::batch
