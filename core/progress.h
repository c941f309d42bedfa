#pragma once

#include <cstdint>
#include <string>

#include "core/error.h"

namespace mvstudio {

/// Receives the progress of one long stage at a time. The base class ignores everything and never cancels.
class ProgressSink {
 public:
  virtual ~ProgressSink() = default;
  virtual void Begin(const std::string& /*stage*/, int64_t /*total*/) {}
  virtual void Advance(int64_t /*done*/, const std::string& /*note*/) {}
  virtual void End() {}
  virtual bool Cancelled() const { return false; }
};

/// Common parameters of every long-running function: progress sink, number of threads, seed.
struct RunContext {
  ProgressSink* progress = nullptr;  ///< not owned; nullptr means silent
  int num_threads = 0;               ///< 0: as many as the machine has
  uint64_t seed = 1;
};

/// One stage of work: begins on construction, ends on destruction, throws CancelledError when cancelled.
class ProgressStage {
 public:
  ProgressStage(const RunContext& run, const std::string& stage, int64_t total) : progress_(run.progress) {
    if (progress_) progress_->Begin(stage, total);
  }
  ~ProgressStage() {
    if (progress_) progress_->End();
  }
  ProgressStage(const ProgressStage&) = delete;
  ProgressStage& operator=(const ProgressStage&) = delete;

  void Advance(int64_t done = 1, const std::string& note = {}) {
    if (!progress_) return;
    progress_->Advance(done, note);
    if (progress_->Cancelled()) throw CancelledError("interrupted");
  }

 private:
  ProgressSink* progress_;
};

}  // namespace mvstudio
