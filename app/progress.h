// Progress of long work, on a terminal only.
#pragma once

#include <string>

namespace vio::app {

/// A bar on standard error; silent where that is not a terminal. The destructor clears the line.
class Progress {
 public:
    explicit Progress(std::string label);
    ~Progress();
    Progress(const Progress&) = delete;
    Progress& operator=(const Progress&) = delete;

    /// share: part that is done, 0 to 1.
    void update(double share);

 private:
    std::string label_;
    bool on_terminal_;
    int drawn_permille_ = -1;
};

}  // namespace vio::app
