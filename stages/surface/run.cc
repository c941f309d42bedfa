#include "stages/surface/run.h"

#include "avatar/body/files/textured_person.h"
#include "avatar/body/measure/known_surface.h"

namespace mvstudio::stages {

SurfaceReport RunSurface(const SurfaceOptions& options, const RunContext& run) {
  const body::KnownSurface truth(options.truth);
  SurfaceReport report{options, {}};
  for (const std::string& path : options.bodies)
    report.scores.push_back(body::ScoreBody(body::ReadPerson(path), truth, options.how, run));
  return report;
}

}  // namespace mvstudio::stages
