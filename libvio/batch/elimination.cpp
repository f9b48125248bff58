#include "libvio/batch/elimination.h"

#include <camd.h>

#include <algorithm>
#include <numeric>
#include <stdexcept>
#include <utility>

namespace vio::batch {
namespace {

using Lists = std::vector<std::vector<int>>;

// Neighbours of each block, without itself, in no order.
Lists neighbours(int blocks, const std::vector<std::pair<int, int>>& pairs, const BlockSets& sets) {
    Lists own(blocks), sets_of(blocks);
    for (const auto& [row, col] : pairs) {
        own[row].push_back(col);
        own[col].push_back(row);
    }
    for (int k = 0; k < sets.count(); ++k)
        for (int i = sets.first[k]; i < sets.first[k + 1]; ++i)
            sets_of[sets.blocks[i]].push_back(k);
    Lists result(blocks);
    std::vector<int> seen_by(blocks, -1);
    for (int block = 0; block < blocks; ++block) {
        const auto add = [&](int other) {
            if (seen_by[other] == block) return;
            seen_by[other] = block;
            result[block].push_back(other);
        };
        seen_by[block] = block;
        for (int other : own[block]) add(other);
        for (int k : sets_of[block])
            for (int i = sets.first[k]; i < sets.first[k + 1]; ++i) add(sets.blocks[i]);
    }
    return result;
}

// Blocks in order of elimination. Minimum degree must know their sizes: each block stands as a
// clique of as many nodes as it has times the largest common divisor of all sizes.
std::vector<int> ordered(const Lists& graph, const std::vector<int>& dims,
                         const std::vector<Part>& parts) {
    const int n = static_cast<int>(graph.size());
    int unit = 0;
    for (int dim : dims) unit = std::gcd(unit, dim);
    std::vector<int> first_node(n + 1, 0);
    for (int k = 0; k < n; ++k) first_node[k + 1] = first_node[k] + dims[k] / unit;
    std::vector<int> starts{0}, rows, constraint, block_of;
    rows.reserve(1);  // nothing coupled at all is no missing array
    for (int k = 0; k < n; ++k)
        for (int node = first_node[k]; node < first_node[k + 1]; ++node) {
            for (int other = first_node[k]; other < first_node[k + 1]; ++other)
                if (other != node) rows.push_back(other);
            for (int neighbour : graph[k])
                for (int other = first_node[neighbour]; other < first_node[neighbour + 1]; ++other)
                    rows.push_back(other);
            starts.push_back(static_cast<int>(rows.size()));
            block_of.push_back(k);
            constraint.push_back(parts[k] == Part::last ? 2 : parts[k] == Part::between ? 1 : 0);
        }
    std::vector<int> nodes(block_of.size());
    const int status = camd_order(static_cast<int>(block_of.size()), starts.data(), rows.data(),
                                  nodes.data(), nullptr, nullptr, constraint.data());
    if (status != CAMD_OK && status != CAMD_OK_BUT_JUMBLED)
        throw std::runtime_error("ordering of the unknowns failed");
    std::vector<int> sequence;
    std::vector<bool> placed(n, false);
    for (int node : nodes)
        if (const int block = block_of[node]; !placed[block]) {
            placed[block] = true;
            sequence.push_back(block);
        }
    return sequence;
}

// Time that a front takes [ns]: arithmetic, passes over its remainder, and its administration. The
// figures are those of one core of a machine of 2020; only their ratios matter.
double front_time(double pivots, double rest) {
    constexpr double kOperation = 0.06, kEntry = 0.8, kFront = 3000;
    const double operations =
        pivots * pivots * pivots / 3 + pivots * pivots * rest + pivots * rest * rest;
    return kOperation * operations + kEntry * rest * rest / 2 + kFront;
}

// A front as it grows: columns that are eliminated together.
struct Growing {
    std::vector<int> columns;  // places in the order of elimination
    std::vector<int> rows;     // likewise, ascending: what the last column is coupled with
    int pivots = 0, rest = 0;  // scalars
    std::vector<int> children;
    int parent = -1;
    bool merged = false;
};

// Symbolic factorisation: each column with its rows and its parent in the elimination tree.
std::vector<Growing> eliminate(const Lists& graph, const std::vector<int>& sequence,
                               const std::vector<int>& order, const std::vector<int>& dims) {
    const int n = static_cast<int>(sequence.size());
    std::vector<Growing> columns(n);
    std::vector<int> seen_by(n, -1);
    for (int j = 0; j < n; ++j) {
        Growing& column = columns[j];
        column.columns = {j};
        column.pivots = dims[sequence[j]];
        seen_by[j] = j;
        const auto add = [&](int row) {
            if (row < j || seen_by[row] == j) return;
            seen_by[row] = j;
            column.rows.push_back(row);
            column.rest += dims[sequence[row]];
        };
        for (int other : graph[sequence[j]]) add(order[other]);
        for (int child : column.children)
            for (int row : columns[child].rows) add(row);
        std::sort(column.rows.begin(), column.rows.end());
        if (column.rows.empty()) continue;
        column.parent = column.rows.front();
        columns[column.parent].children.push_back(j);
    }
    return columns;
}

// Merges columns into fronts wherever this saves time.
void merge(std::vector<Growing>& columns) {
    for (Growing& front : columns) {
        std::sort(front.children.begin(), front.children.end(),
                  [&](int a, int b) { return columns[a].rest > columns[b].rest; });
        std::vector<int> kept;
        for (size_t k = 0; k < front.children.size(); ++k) {
            const int c = front.children[k];
            Growing& child = columns[c];
            const double apart =
                front_time(child.pivots, child.rest) + front_time(front.pivots, front.rest);
            if (front_time(child.pivots + front.pivots, front.rest) > apart) {
                kept.push_back(c);
                continue;
            }
            front.columns.insert(front.columns.end(), child.columns.begin(), child.columns.end());
            front.pivots += child.pivots;
            front.children.insert(front.children.end(), child.children.begin(),
                                  child.children.end());
            child.merged = true;
        }
        front.children = std::move(kept);
    }
    for (size_t j = 0; j < columns.size(); ++j)
        if (!columns[j].merged)
            for (int c : columns[j].children) columns[c].parent = static_cast<int>(j);
}

Part joined(Part a, Part b) {
    if (a == b) return a;
    return Part::between;
}

// The unmerged fronts with all that is below them, children first.
std::vector<int> in_postorder(const std::vector<Growing>& columns) {
    std::vector<int> result;
    std::vector<std::pair<int, size_t>> stack;
    for (size_t root = 0; root < columns.size(); ++root) {
        if (columns[root].merged || columns[root].parent >= 0) continue;
        stack.emplace_back(static_cast<int>(root), 0);
        while (!stack.empty()) {
            auto& [front, next] = stack.back();
            if (next < columns[front].children.size()) {
                stack.emplace_back(columns[front].children[next++], 0);
                continue;
            }
            result.push_back(front);
            stack.pop_back();
        }
    }
    return result;
}

// Places for the fronts' remainders in working memory: each lives from its front to its parent.
void place_updates(EliminationPlan& plan) {
    struct Live {
        long begin, end;
        int until;
    };
    std::vector<Live> live[3];  // by begin
    for (size_t f = 0; f < plan.fronts.size(); ++f) {
        Front& front = plan.fronts[f];
        const int part = std::min(static_cast<int>(front.part), 2);
        auto& list = live[part];
        std::erase_if(list, [&](const Live& l) { return l.until < static_cast<int>(f); });
        const long need = static_cast<long>(front.rest()) * front.rest();
        long begin = 0;
        auto place = list.begin();
        while (place != list.end() && place->begin - begin < need) begin = (place++)->end;
        front.update = begin;
        if (need > 0) list.insert(place, {begin, begin + need, front.parent});
        plan.working[part] = std::max(plan.working[part], begin + need);
    }
}

void link(EliminationPlan& plan) {
    for (Front& front : plan.fronts) {
        if (front.parent < 0) continue;
        const Front& parent = plan.fronts[front.parent];
        for (size_t k = front.pivot_blocks; k < front.blocks.size(); ++k) {
            const int from = front.starts[k] - front.pivots,
                      to = parent.row_of(front.blocks[k], plan.order),
                      length = front.starts[k + 1] - front.starts[k];
            // A run may not cross from the parent's pivots to its other rows.
            if (!front.runs.empty()) {
                Front::Run& last = front.runs.back();
                if (last.to + last.length == to && (to != parent.pivots)) {
                    last.length += length;
                    continue;
                }
            }
            front.runs.push_back({from, to, length});
        }
    }
}

}  // namespace

int Front::row_of(int block, const std::vector<int>& order) const {
    const auto it = std::lower_bound(blocks.begin(), blocks.end(), block,
                                     [&](int a, int b) { return order[a] < order[b]; });
    if (it == blocks.end() || *it != block)
        throw std::logic_error("no such block in the factor's front");
    return starts[it - blocks.begin()];
}

double EliminationPlan::operations() const {
    double sum = 0;
    for (const Front& f : fronts) {
        const double p = f.pivots, r = f.rest();
        sum += p * p * p / 3 + p * p * r + p * r * r;
    }
    return sum;
}

EliminationPlan plan_elimination(const std::vector<int>& dims,
                                 const std::vector<std::pair<int, int>>& pairs,
                                 const BlockSets& sets, const std::vector<Part>& parts) {
    const int n = static_cast<int>(dims.size());
    EliminationPlan plan;
    plan.offsets.assign(n + 1, 0);
    std::partial_sum(dims.begin(), dims.end(), plan.offsets.begin() + 1);
    const Lists graph = neighbours(n, pairs, sets);
    const std::vector<int> sequence = ordered(graph, dims, parts);
    plan.order.resize(n);
    for (int k = 0; k < n; ++k) plan.order[sequence[k]] = k;
    std::vector<Growing> columns = eliminate(graph, sequence, plan.order, dims);
    merge(columns);

    std::vector<int> post = in_postorder(columns);
    std::vector<Part> part_of(n);
    for (int j : post) {
        Part part = parts[sequence[columns[j].columns.front()]];
        for (int column : columns[j].columns) part = joined(part, parts[sequence[column]]);
        for (int child : columns[j].children) part = joined(part, part_of[child]);
        part_of[j] = part;
    }
    // Halves first; what is between keeps its order (children before parents).
    std::stable_sort(post.begin(), post.end(), [&](int a, int b) {
        return std::min(static_cast<int>(part_of[a]), 2) <
               std::min(static_cast<int>(part_of[b]), 2);
    });

    plan.front_of.resize(n);
    std::vector<int> place(n);
    for (size_t f = 0; f < post.size(); ++f) place[post[f]] = static_cast<int>(f);
    for (int j : post) {
        Growing& growing = columns[j];
        Front front;
        front.parent = growing.parent < 0 ? -1 : place[growing.parent];
        front.part = part_of[j];
        std::sort(growing.columns.begin(), growing.columns.end());
        front.pivot_blocks = static_cast<int>(growing.columns.size());
        for (const auto* list : {&growing.columns, &growing.rows})
            for (int k : *list) {
                front.starts.push_back(front.size);
                front.blocks.push_back(sequence[k]);
                front.size += dims[sequence[k]];
            }
        front.starts.push_back(front.size);
        front.pivots = growing.pivots;
        front.panel = plan.values;
        plan.values += static_cast<long>(front.size) * front.pivots;
        for (int column : growing.columns)
            plan.front_of[sequence[column]] = static_cast<int>(plan.fronts.size());
        plan.fronts.push_back(std::move(front));
    }
    link(plan);
    place_updates(plan);
    return plan;
}

}  // namespace vio::batch
