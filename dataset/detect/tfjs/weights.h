// Private: a step of ParseTfjs.
#pragma once

#include <map>
#include <string>

#include "dataset/detect/tfjs/json_parse.h"
#include "dataset/detect/tfjs/parsed_graph.h"

namespace mvstudio::detect::internal {

/// Decodes all weights of `weightsManifest`; those of a group are stored one after the other in its files. Throws
/// FormatError for files that are too short or too long, or for invalid types and shapes.
std::map<std::string, TfWeight> ReadWeights(const JsonView& manifest, const std::map<std::string, std::string>& shards);

/// IEEE 754 half precision.
float HalfToFloat(uint16_t half);

}  // namespace mvstudio::detect::internal
