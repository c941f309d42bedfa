#pragma once

#include <string>
#include <vector>

#include "dataset/markers/marker_take.h"

/// Files that OpenSim 4 opens beside a .trc, for models with the bodies of Rajagopal et al., "Full-Body Musculoskeletal Model
/// for Muscle-Driven Simulation of Human Gait", IEEE TBME 2016 (pelvis, femur_r, tibia_r, talus_r, calcn_r, toes_r, torso,
/// humerus_r, ulna_r, hand_r, and the left ones).
namespace mvstudio::markers {

/// The markers of `names` that have a place on such a model; others are left out of all three files.
std::vector<std::string> OpenSimMarkers(const std::vector<std::string>& names);

/// MarkerSet. A joint's marker lies where the model has the joint: at the origin of the body beyond it. Neck, head, toes and
/// heels are where such a model of 1.75 m has them, free to be moved by the marker placer.
std::string OpenSimMarkerSet(const std::vector<std::string>& names);

/// ScaleTool: each segment by the distance of the markers at its ends. Free markers are placed by the half second in which the
/// markers move least. Names of files are relative to the file's folder: STEM.trc and STEM.markers.xml are read,
/// STEM.scaled.osim is written, a model for each person.
std::string OpenSimScaling(const MarkerTake& take, const std::string& stem);

/// InverseKinematicsTool for STEM.scaled.osim and STEM.trc, to STEM.ik.mot; joints weigh 1, free markers 0.5.
std::string OpenSimInverseKinematics(const MarkerTake& take, const std::string& stem);

}  // namespace mvstudio::markers
