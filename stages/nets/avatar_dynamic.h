#pragma once

#include <string>

#include "avatar/body/dynamic/dynamic_fit.h"
#include "stages/result.h"

/// What the fit says of a surface that moves with the pose.
namespace mvstudio::stages {

/// Null where nobody asked; else whether it is kept, why, its size, and the gains in each block left out.
nlohmann::ordered_json ToJson(const body::DynamicFit& fit);
std::string ToTable(const body::DynamicFit& fit);

}  // namespace mvstudio::stages
