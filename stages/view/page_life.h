#pragma once

#include <chrono>
#include <string>

namespace mvstudio::stages {

/// When a page that asks `alive` every two seconds, and `bye` as it closes, is gone.
class PageLife {
 public:
  /// `idle_min`: minutes without a request that count as closed; 0: none do.
  explicit PageLife(double idle_min) : idle_min_(idle_min) {}

  /// A request for a path.
  void Ask(const std::string& path) {
    last_ = Clock::now();
    is_bye_ = path == "bye";
    was_asked_ = true;
  }
  bool is_over() const {
    constexpr std::chrono::seconds kAfterBye(5);  // a page that is loaded anew says farewell, too; another one asks each two
    const auto silent = Clock::now() - last_;
    if (is_bye_) return silent > kAfterBye;
    return was_asked_ && idle_min_ > 0 && silent > std::chrono::duration<double>(60 * idle_min_);
  }

 private:
  using Clock = std::chrono::steady_clock;

  double idle_min_;
  Clock::time_point last_ = Clock::now();
  bool is_bye_ = false, was_asked_ = false;
};

}  // namespace mvstudio::stages
