#pragma once

#include <ATen/core/Tensor.h>

#include <functional>
#include <memory>
#include <string>

/// Several processes that train one avatar on a part of each step's pictures each.
namespace mvstudio::avatar {

struct RankPlace {
  int rank = 0;
  int size = 1;
  std::string rendezvous;               ///< a file that all ranks can see; it must not be there before the first of them begins
  bool one_machine = true;              ///< they talk over the loopback address; else over that of the machine's name
  std::function<void()> while_waiting;  ///< called several times a second until all are there; may throw to give up
};

/// The processes as one of them sees them. All of them must make the same calls in the same order.
class Ranks {
 public:
  virtual ~Ranks() = default;
  virtual int rank() const = 0;
  virtual int size() const = 0;
  /// Sums over the ranks in place, on the CPU, contiguous, float32 or float64; the same bytes on each. Throws IoError when
  /// another process has ended.
  virtual void Sum(at::Tensor& values) const = 0;
  /// Everyone's values become those of rank 0; any device. Throws as above.
  virtual void Broadcast(at::Tensor& values) const = 0;
};

/// Waits up to five minutes for the others. Throws UsageError for a place that cannot be, IoError when they do not come, and
/// MissingToolError when libtorch's Gloo was not there when this program was built.
std::shared_ptr<const Ranks> JoinRanks(const RankPlace& place);

}  // namespace mvstudio::avatar
