// The objects of a rawlog one after another, read and written strictly.
#pragma once

#include <mrpt/serialization/CSerializable.h>

#include <string>

#include "libvio/base/errors.h"
#include "libvio/io/gz_stream.h"

namespace vio {

/// Reads a rawlog object by object. MRPT's own reader gives the same answer to a clean end, a cut
/// and junk; this one tells them apart.
class RawlogObjects {
 public:
    /// Throws InputError for a missing file, and for what refuse_foreign_input() knows.
    explicit RawlogObjects(const std::string& file);

    /// Next object; null at the clean end. Throws InputError where the file is foreign, cut off or
    /// damaged, or holds a class that is not known.
    mrpt::serialization::CSerializable::Ptr next();

    /// "FILE (object N): problem", N being the object read last (from 1).
    InputError error(const std::string& problem) const;
    double progress() const { return input_.progress(); }

 private:
    InputError failure(const std::string& reason) const;

    GzInput input_;
    long count_ = 0;  ///< objects read
};

/// Writes an object as MRPT's archives do. Throws InputError as the file does: an archive on the
/// file itself would wrap that into an exception of MRPT's, of several lines.
void write_object(const mrpt::serialization::CSerializable& object, GzOutput& out);

}  // namespace vio
