#pragma once

#include <map>
#include <string>

#include "stages/result.h"

/// Datasets call cameras 00_NN, as Panoptic does; who trains an avatar knows them by the studio's names.
namespace mvstudio::stages {

/// Panoptic's names of the dataset's cameras, and the studio's. Empty where the dataset does not know them, or cannot be read.
std::map<std::string, std::string> StudioNames(const std::string& dataset_folder);

/// Calls the cameras by these names in all that a result says. Parts of paths and file names stay.
CommandResult NamedCameras(CommandResult result, const std::map<std::string, std::string>& names);

/// `text` with each of `names`, where it stands as a word of its own, replaced by what it maps to.
std::string WithNames(const std::string& text, const std::map<std::string, std::string>& names);

}  // namespace mvstudio::stages
