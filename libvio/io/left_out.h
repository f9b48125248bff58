// Measurements that nothing can be made of: left out, counted, and told.
#pragma once

#include <string>
#include <vector>

#include "libvio/base/errors.h"

namespace vio {

/// One measurement that cannot be used: a value that is not finite, a missing image file, no stamp.
/// Those after it are not touched by it, as they are by damage of the file.
class UnusableMeasurement : public InputError {
 public:
    using InputError::InputError;
};

/// Measurements of one kind that were left out.
struct LeftOut {
    std::string what;  ///< in the plural: "images"
    int count = 0;
    std::string first;  ///< of the first one: its place and what is wrong with it
};

/// "3 images; the first: FILE (object 12): image file ... is missing".
std::string one_line(const LeftOut& left_out);

/// What was left out of a recording, by kind, in order of first appearance.
class LeftOutList {
 public:
    void add(const std::string& what, const std::string& reason);
    void add(const LeftOutList& others);

    const std::vector<LeftOut>& kinds() const { return kinds_; }
    bool empty() const { return kinds_.empty(); }
    int total() const;

 private:
    void add(const LeftOut& more);

    std::vector<LeftOut> kinds_;
};

}  // namespace vio
