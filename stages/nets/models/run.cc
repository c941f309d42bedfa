#include "stages/nets/models/run.h"

#include "core/error.h"

namespace mvstudio::stages {

ModelsReport FetchModels(const ModelsOptions& options, const RunContext& run) {
  const auto poll = [&] {
    if (run.progress && run.progress->Cancelled()) throw CancelledError("interrupted");
  };
  ModelsReport report;
  report.from = options.tarball;
  report.installed = options.tarball.empty() ? detect::FetchModels(options.folder, poll)
                                             : detect::InstallModels(options.tarball, options.folder);
  report.models = detect::ListModels(options.folder);
  return report;
}

ModelsReport ListModels(const ModelsOptions& options) {
  ModelsReport report;
  report.models = detect::ListModels(options.folder);
  return report;
}

}  // namespace mvstudio::stages
