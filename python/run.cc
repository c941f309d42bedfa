#include "python/run.h"

#include <atomic>
#include <chrono>
#include <condition_variable>
#include <exception>
#include <mutex>
#include <string>
#include <thread>

namespace mvstudio::python {
namespace py = pybind11;
namespace {

/// The latest state of a run, written by its threads and read by Python's.
class LatestProgress : public ProgressSink {
 public:
  struct State {
    std::string stage, note;
    int64_t done = 0, total = 0;
    int version = 0;
  };

  void Begin(const std::string& stage, int64_t total) override {
    const std::lock_guard<std::mutex> lock(mutex_);
    state_ = {stage, "", 0, total, state_.version + 1};
  }
  void Advance(int64_t done, const std::string& note) override {
    const std::lock_guard<std::mutex> lock(mutex_);
    state_.done += done, state_.note = note, ++state_.version;
  }
  bool Cancelled() const override { return cancelled_; }

  void Cancel() { cancelled_ = true; }
  State state() const {
    const std::lock_guard<std::mutex> lock(mutex_);
    return state_;
  }

 private:
  mutable std::mutex mutex_;
  State state_;
  std::atomic<bool> cancelled_{false};
};

/// Work on a thread that is awaited in short steps.
class Worker {
 public:
  explicit Worker(const std::function<void()>& work)
      : thread_([this, work] {
          try {
            work();
          } catch (...) {
            error_ = std::current_exception();
          }
          const std::lock_guard<std::mutex> lock(mutex_);
          ended_ = true;
          has_ended_.notify_one();
        }) {}
  ~Worker() { thread_.join(); }
  Worker(const Worker&) = delete;
  Worker& operator=(const Worker&) = delete;

  bool AwaitEnd(std::chrono::milliseconds most) {
    std::unique_lock<std::mutex> lock(mutex_);
    return has_ended_.wait_for(lock, most, [this] { return ended_; });
  }
  const std::exception_ptr& error() const { return error_; }

 private:
  std::mutex mutex_;
  std::condition_variable has_ended_;
  bool ended_ = false;
  std::exception_ptr error_;
  std::thread thread_;  // last: it uses the others
};

}  // namespace

void RunWatched(const RunArguments& arguments, const std::function<void(const RunContext&)>& work) {
  LatestProgress progress;
  std::exception_ptr error, interrupted;
  int reported = 0;
  const auto report = [&] {
    if (PyErr_CheckSignals() != 0) throw py::error_already_set();
    const LatestProgress::State state = progress.state();
    if (arguments.progress.is_none() || state.version == reported) return;
    reported = state.version;
    arguments.progress(state.stage, state.done, state.total, state.note);
  };
  {
    const py::gil_scoped_release others_run;
    Worker worker([&] { work({&progress, arguments.threads, arguments.seed}); });
    while (!worker.AwaitEnd(std::chrono::milliseconds(50))) {
      const py::gil_scoped_acquire python;
      try {
        if (!interrupted) report();
      } catch (...) {
        interrupted = std::current_exception();
        progress.Cancel();
      }
    }
    error = worker.error();
  }
  if (interrupted) std::rethrow_exception(interrupted);
  if (error) std::rethrow_exception(error);
  report();
}

}  // namespace mvstudio::python
