#pragma once

#include <ATen/core/Tensor.h>

#include <functional>
#include <memory>
#include <string>

/// Several processes that train one avatar, each on part of each step's images.
namespace mvstudio::avatar {

struct RankPlace {
  int rank = 0;
  int size = 1;
  std::string rendezvous;   ///< a file visible to all ranks; what a training that was killed left in it is passed over
  bool one_machine = true;  ///< they communicate over the loopback address; else over that of the machine's name
  std::function<void()> while_waiting;  ///< called several times a second until all have joined; may throw to give up
};

/// The group of processes, seen from one of them. All must make the same calls in the same order.
class Ranks {
 public:
  virtual ~Ranks() = default;
  virtual int rank() const = 0;
  virtual int size() const = 0;
  /// Sums over the ranks in place, on the CPU, contiguous, float32 or float64; the same bytes on each. Throws IoError when
  /// another process has ended.
  virtual void Sum(at::Tensor& values) const = 0;
  /// Replaces the values on every rank by those of rank 0; any device. Throws as above.
  virtual void Broadcast(at::Tensor& values) const = 0;
};

/// Waits up to five minutes for the others. Throws UsageError for an invalid place, IoError when they do not join, and
/// MissingToolError when libtorch's Gloo was not available when this program was built.
std::shared_ptr<const Ranks> JoinRanks(const RankPlace& place);

}  // namespace mvstudio::avatar
