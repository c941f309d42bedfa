#include "stages/session/run.h"

#include <algorithm>
#include <filesystem>
#include <optional>

#include "core/disk/output.h"
#include "dataset/session/trust.h"

namespace mvstudio::stages {

SessionShowReport RunSessionShow(const SessionShowOptions& options, const RunContext& run) {
  dataset::InspectOptions how;
  how.allow_outside = options.allow_outside, how.decode = options.decode, how.compare = false;
  SessionShowReport report{options, dataset::ReadSession(options.folder, options.allow_outside), {}};
  report.footage = dataset::InspectSession(report.session, how, run);
  return report;
}

SessionTrustReport RunSessionTrust(const SessionTrustOptions& options) {
  const dataset::Session session = dataset::ReadSession(options.folder, true);
  SessionTrustReport report{options, {}, dataset::TrustFile()};
  if (!options.forget) report.folders = dataset::FoldersOutside(session);
  dataset::TrustSession(session.folder, report.folders);
  return report;
}

SessionTimelineReport RunSessionTimeline(const SessionTimelineOptions& options, const RunContext& run) {
  SessionTimelineReport report;
  const dataset::Session session = dataset::ReadSession(options.folder, options.how.allow_outside);
  const dataset::SessionTake& take = dataset::TakeOf(session, options.take);
  report.take = take.name, report.unknown_keys = session.warnings;
  report.made = dataset::BuildTakeTimeline(session, take, options.how, run);
  for (const dataset::SessionCamera& camera : session.cameras) {
    const auto filmed = [&](const dataset::SessionFootage& f) { return f.camera == camera.name; };
    if (std::none_of(take.footage.begin(), take.footage.end(), filmed)) report.unfilmed.push_back(camera.name);
  }
  for (const dataset::SessionFootage& f : take.footage)
    report.inputs.push_back((std::filesystem::path(session.folder) / f.path).string());
  report.file = options.out.empty() ? dataset::TimelinePath(session, take.name) : options.out;
  std::optional<OutputFiles> place;
  if (!options.out.empty()) place.emplace(std::vector<std::string>{report.file}, report.inputs);
  dataset::WriteTimeline(report.made.timeline, report.file);
  return report;
}

}  // namespace mvstudio::stages
