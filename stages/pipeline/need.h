#pragma once

#include <cstdint>
#include <vector>

#include "stages/pipeline/pipeline.h"

/// What a stage needs of a machine, foretold from its footage.
namespace mvstudio::stages {

struct FootageSize {
  int cameras = 0;
  double megapixels = 0;   ///< of the largest image, 10^6 pixels
  int64_t num_frames = 0;  ///< of the camera with the most
};

/// By the flags' defaults; memory and disk of a measured run are within a factor of two, seconds of stages over a second within
/// one of 1.5 (docs/how-to-run-on-a-cluster.md). Seconds are without the start of the program. Not known for networks whose
/// weights differ, for what was not measured, and for footage of unknown length.
StageNeed NeedOf(StageKind kind, const FootageSize& size);
/// Of one thread; the part of NeedOf that grows with the images.
double ImageSeconds(StageKind kind, double megapixels);

/// Fills `need` of the stages that are not left out. Opens each video; what cannot be opened is not known.
void PredictNeeds(const dataset::Session& session, const PipelineOptions& options, std::vector<PipelineStage>* stages);

}  // namespace mvstudio::stages
