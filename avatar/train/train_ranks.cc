#include "avatar/train/train_ranks.h"

#include <ATen/ATen.h>

#include <chrono>
#include <cstdlib>
#include <thread>

#include "core/check.h"
#include "core/error.h"

#if defined(USE_C10D_GLOO) && __has_include(<gloo/config.h>)
#define MVSTUDIO_GLOO 1
#include <torch/csrc/distributed/c10d/FileStore.hpp>
#include <torch/csrc/distributed/c10d/ProcessGroupGloo.hpp>
#endif

namespace mvstudio::avatar {
namespace {

#ifdef MVSTUDIO_GLOO

std::string FirstLine(const std::exception& error) {
  const std::string text = error.what();
  return text.substr(0, text.find('\n'));
}

/// GLOO_SOCKET_IFNAME names a network where machines have several, as in PyTorch.
std::shared_ptr<::gloo::transport::Device> DeviceFor(const RankPlace& place) {
  if (place.one_machine) return c10d::ProcessGroupGloo::createDeviceForHostname("127.0.0.1");
  const char* network = std::getenv("GLOO_SOCKET_IFNAME");
  return network && *network ? c10d::ProcessGroupGloo::createDeviceForInterface(network)
                             : c10d::ProcessGroupGloo::createDefaultDevice();
}

class GlooRanks : public Ranks {
 public:
  explicit GlooRanks(const RankPlace& place) : place_(place) {
    const auto store = c10::make_intrusive<c10d::FileStore>(place.rendezvous, place.size);
    WaitForAll(*store);
    Guarded("did not find the other ranks", [&] {
      const auto options = c10d::ProcessGroupGloo::Options::create();
      options->devices.push_back(DeviceFor(place));
      group_ = c10::make_intrusive<c10d::ProcessGroupGloo>(store, place.rank, place.size, options);
    });
  }

  int rank() const override { return place_.rank; }
  int size() const override { return place_.size; }

  void Sum(at::Tensor& values) const override {
    MVS_CHECK(values.device().is_cpu() && values.is_contiguous(), "a sum over ranks needs a contiguous tensor on the CPU");
    Guarded("lost the other ranks", [&] {
      std::vector<at::Tensor> tensors = {values};
      group_->allreduce(tensors)->wait();
    });
  }

  void Broadcast(at::Tensor& values) const override {
    std::vector<at::Tensor> tensors = {values.detach().to(at::kCPU).contiguous().clone()};
    Guarded("lost the other ranks", [&] { group_->broadcast(tensors)->wait(); });
    const at::NoGradGuard no_gradients;
    values.copy_(tensors[0]);
  }

 private:
  /// Gloo itself would wait for half an hour.
  void WaitForAll(c10d::FileStore& store) const {
    constexpr auto kPause = std::chrono::milliseconds(50);
    constexpr auto kLongest = std::chrono::minutes(5);
    const auto key = [](int rank) { return "here_" + std::to_string(rank); };
    Guarded("cannot use the file", [&] { store.set(key(place_.rank), std::vector<uint8_t>{1}); });
    const auto start = std::chrono::steady_clock::now();
    for (int rank = 0; rank < place_.size; ++rank) {
      while (!store.check({key(rank)})) {
        if (place_.while_waiting) place_.while_waiting();
        if (std::chrono::steady_clock::now() - start > kLongest)
          throw IoError(place_.rendezvous, "rank " + std::to_string(rank) + " of " + std::to_string(place_.size) +
                                               " did not come within five minutes; start all of them again with a new file");
        std::this_thread::sleep_for(kPause);
      }
    }
  }

  template <class Call>
  void Guarded(const char* what, const Call& call) const {
    try {
      call();
    } catch (const std::exception& error) {
      throw IoError(place_.rendezvous, "rank " + std::to_string(place_.rank) + " of " + std::to_string(place_.size) + " " +
                                           what + " (" + FirstLine(error) + "); start all of them again with a new file");
    }
  }

  RankPlace place_;
  c10::intrusive_ptr<c10d::ProcessGroupGloo> group_;
};

#endif

}  // namespace

std::shared_ptr<const Ranks> JoinRanks(const RankPlace& place) {
  if (place.size < 1 || place.rank < 0 || place.rank >= place.size)
    throw UsageError("option 'rank' " + std::to_string(place.rank) + " of option 'world-size' " + std::to_string(place.size) +
                     ": ranks count from 0 to one less than their number");
  if (place.rendezvous.empty()) throw UsageError("option 'rendezvous': several ranks need a file to find each other");
#ifdef MVSTUDIO_GLOO
  return std::make_shared<GlooRanks>(place);
#else
  throw MissingToolError("several ranks need libtorch with Gloo and its headers (libgloo-dev); this program was built without");
#endif
}

}  // namespace mvstudio::avatar
