#include "stages/people/apply_sync.h"

#include <cmath>
#include <vector>

#include "dataset/time/sync_file.h"
#include "triangulate/sync/sync.h"

namespace mvstudio::stages {

void ApplySync(const std::string& path, PoseInput* input, InputNotes* notes) {
  const dataset::SyncFile sync = dataset::ReadSync(path);
  const std::vector<std::string> names = geometry::CameraNames(input->rig);
  const std::vector<double> offsets = dataset::OffsetsOf(sync, names), rates = dataset::RatesOf(sync, names);
  notes->inputs.push_back(path);
  std::vector<triangulate::Clock> clocks;
  for (size_t c = 0; c < names.size(); ++c) clocks.push_back({offsets[c], rates[c]});
  for (const std::string& camera : input->cameras) {
    if (std::isfinite(offsets[static_cast<size_t>(input->rig.Find(camera))])) continue;
    notes->warnings.push_back({"TRI-NO-OFFSET", camera + ": " + path + " has no time offset for it, it is left out",
                               "run `mvstudio sync` again with more motion, or set its offset_frames in the file"});
  }
  input->frames = triangulate::ApplyClocks(input->frames, clocks, triangulate::kMeasuredBeyond);
}

}  // namespace mvstudio::stages
