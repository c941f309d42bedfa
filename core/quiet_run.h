#pragma once

#include "core/progress.h"

namespace mvstudio {

/// Passes a wish to stop on, and shows nothing: for work that is no stage of its own, or runs beside other work.
class QuietProgress : public ProgressSink {
 public:
  /// `shown` may be nullptr and must outlive this object.
  explicit QuietProgress(const ProgressSink* shown) : shown_(shown) {}
  bool Cancelled() const override { return shown_ && shown_->Cancelled(); }

 private:
  const ProgressSink* shown_;
};

/// A run like another, with its threads and seed, that shows nothing and stops where that is asked to.
class QuietRun {
 public:
  explicit QuietRun(const RunContext& run) : progress_(run.progress), context_{&progress_, run.num_threads, run.seed} {}
  QuietRun(const QuietRun&) = delete;
  QuietRun& operator=(const QuietRun&) = delete;
  /// Valid while this object lives.
  const RunContext& context() const { return context_; }

 private:
  QuietProgress progress_;
  RunContext context_;
};

}  // namespace mvstudio
