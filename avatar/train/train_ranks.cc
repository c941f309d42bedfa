#include "avatar/train/train_ranks.h"

#include <ATen/ATen.h>

#include <chrono>
#include <cstdlib>
#include <functional>
#include <random>
#include <sstream>
#include <string>
#include <thread>

#include "core/check.h"
#include "core/error.h"

#if defined(USE_C10D_GLOO) && __has_include(<gloo/config.h>)
#define MVSTUDIO_GLOO 1
#include <torch/csrc/distributed/c10d/FileStore.hpp>
#include <torch/csrc/distributed/c10d/PrefixStore.hpp>
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
    const std::string team = WaitForAll(*store);
    Guarded("did not find the other ranks", [&] {
      const auto options = c10d::ProcessGroupGloo::Options::create();
      options->devices.push_back(DeviceFor(place));
      const auto own = c10::make_intrusive<c10d::PrefixStore>(team, store);
      group_ = c10::make_intrusive<c10d::ProcessGroupGloo>(own, place.rank, place.size, options);
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
  /// Gloo itself would wait for half an hour, and would take the addresses that a killed training left in the file for those
  /// of this one. So each rank has a name that no other run has; the first rank lists the names, and goes on when all have
  /// confirmed the list that holds its own. Returns the list.
  std::string WaitForAll(c10d::FileStore& store) const {
    const std::string own = NewName();
    Set(store, "here_" + std::to_string(place_.rank), own);
    std::string team;
    const auto is_listed = [&] {
      team = Get(store, "team");
      return PartOf(team, place_.rank) == own;
    };
    if (place_.rank == 0) {
      Wait([&] { return IsTeam(store, own, &team); });
      Set(store, "go", team);
    } else {
      Wait([&] {
        if (is_listed() && Get(store, Confirmed(place_.rank)) != team) Set(store, Confirmed(place_.rank), team);
        return is_listed() && Get(store, "go") == team;
      });
    }
    return team;
  }

  /// Lists who is there now; true when every one of them has confirmed that list.
  bool IsTeam(c10d::FileStore& store, const std::string& own, std::string* team) const {
    std::string now = own;
    for (int rank = 1; rank < place_.size; ++rank) now += ' ' + Get(store, "here_" + std::to_string(rank));
    if (now != *team) Set(store, "team", *team = now);
    for (int rank = 1; rank < place_.size; ++rank) {
      if (Get(store, Confirmed(rank)) != now) return false;
    }
    return true;
  }

  static std::string Confirmed(int rank) { return "confirmed_" + std::to_string(rank); }

  static std::string NewName() {
    std::random_device random;
    return std::to_string(random()) + "." + std::to_string(random());
  }

  static std::string PartOf(const std::string& team, int rank) {
    std::istringstream names(team);
    std::string name;
    for (int i = 0; i <= rank; ++i) names >> name;
    return names ? name : "";
  }

  void Set(c10d::FileStore& store, const std::string& key, const std::string& value) const {
    Guarded("cannot use the file", [&] { store.set(key, std::vector<uint8_t>(value.begin(), value.end())); });
  }

  /// Empty where nobody has set it.
  std::string Get(c10d::FileStore& store, const std::string& key) const {
    std::vector<uint8_t> value;
    Guarded("cannot use the file", [&] {
      if (store.check({key})) value = store.get(key);
    });
    return {value.begin(), value.end()};
  }

  void Wait(const std::function<bool()>& are_there) const {
    constexpr auto kPause = std::chrono::milliseconds(50);
    constexpr auto kLongest = std::chrono::minutes(5);
    const auto start = std::chrono::steady_clock::now();
    while (!are_there()) {
      if (place_.while_waiting) place_.while_waiting();
      if (std::chrono::steady_clock::now() - start > kLongest)
        throw IoError(place_.rendezvous, "not all of " + std::to_string(place_.size) +
                                             " ranks came within five minutes of rank " + std::to_string(place_.rank) +
                                             "; start all of them again");
      std::this_thread::sleep_for(kPause);
    }
  }

  template <class Call>
  void Guarded(const char* what, const Call& call) const {
    try {
      call();
    } catch (const std::exception& error) {
      throw IoError(place_.rendezvous, "rank " + std::to_string(place_.rank) + " of " + std::to_string(place_.size) + " " +
                                           what + " (" + FirstLine(error) + "); start all of them again");
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
