#include "cli/program/input_flags.h"

#include "cli/program/arguments.h"
#include "cli/program/options.h"
#include "core/join.h"

namespace mvstudio::cli {

void AddReadOptions(CLI::App* sub, stages::CalibReadOptions& options) {
  AddChoice(sub, "--from", options.from, "format of the input: auto, " + calib::CalibrationFormatNames())
      ->capture_default_str()
      ->type_name("FORMAT")
      ->check(OneOf(stages::CalibrationFormatChoices()));
  AddChoice(sub, "--size", options.size, "WIDTHxHEIGHT px: image size where the file does not give it");
  AddChoice(sub, "--unit", options.unit, "unit of length of files that name none: m, cm, mm or in")
      ->capture_default_str()
      ->check(OneOf({"m", "cm", "mm", "in"}));
  AddOption(sub, "--qca-distortion-divisor", options.qca_distortion_divisor,
            "qca: the distortion is divided by this when read, multiplied when written (1: coefficients as they stand; 64: as "
            "Pose2Sim does)")
      ->capture_default_str()
      ->check(CLI::PositiveNumber);
  AddMeaningOptions(sub, options);
}

void AddMeaningOptions(CLI::App* sub, stages::CalibReadOptions& options) {
  AddChoice(sub, "--lens", options.lens,
            "auto, perspective or fisheye: of files that do not say it (opencv, easymocap, nerfstudio, toml)")
      ->capture_default_str();
  AddPoseMendingOptions(sub, options.invert, options.mirror);
  AddOption(
      sub, "--allow-approximation", options.allow_approximation_px,
      "px; the nearest lens takes the place of one that cannot be kept: when reading one with skew, when writing one that the "
      "format lacks. Refused where a pixel of the image moves farther")
      ->capture_default_str()
      ->check(CLI::NonNegativeNumber);
}

void AddPoseMendingOptions(CLI::App* sub, bool& invert, bool& mirror) {
  AddFlag(sub, "--invert", invert,
          "the file gives poses the other way round (world from camera for camera from world): invert them");
  AddFlag(sub, "--mirror", mirror,
          "the file is left-handed (x right, y up, z forward, of world and cameras): turn y over in both");
}

void AddTakeArguments(CLI::App* sub, stages::TakeArguments& arguments) {
  const GroupScope footage(sub, "Footage");
  AddChoices(sub, "--video", arguments.video, "CAMERA=FILE; repeat for each camera")->allow_extra_args(true);
  AddChoices(sub, "--images", arguments.images, "CAMERA=FOLDER or CAMERA=PATTERN; the number in an image's name is its frame");
  AddChoices(sub, "--plate", arguments.plate, "CAMERA=FILE: image of the empty scene");
  AddOption(sub, "--session", arguments.session, "folder with mvstudio.toml: footage, plates and calibration come from it");
  AddOption(sub, "--take", arguments.take, "take of the session; its only one with people unless given");
  AddFlag(sub, "--allow-outside", arguments.allow_outside, "allow the session to name files outside its folder");
}

void AddSessionArguments(CLI::App* sub, stages::SessionArguments& arguments, const std::string& what,
                         const std::string& unless_given) {
  const GroupScope session(sub, "Session");
  AddOption(sub, "--session", arguments.session, "folder with mvstudio.toml: " + what + " come from it");
  AddOption(sub, "--take", arguments.take, "take of the session; its only one with " + unless_given + " unless given");
  AddFlag(sub, "--allow-outside", arguments.allow_outside, "allow the session to name files outside its folder");
}

void AddSkeletonOption(CLI::App* sub, std::string& skeleton, const std::string& what) {
  AddOption(sub, "--skeleton", skeleton, what + ": a name that triangulate knows, or a file FILE.toml (docs/formats.md)");
}

namespace {

/// NAMES of cameras, or the flag alone for all.
void AddCameraSet(CLI::App* sub, const std::string& name, stages::CameraSet& cameras, const std::string& help) {
  AddWordsOption(
      sub, name,
      [&cameras, name](const std::vector<std::string>& texts) { FromString(Join(texts, ","), name.substr(2), &cameras); },
      [&cameras] { return ToString(cameras); }, help)
      ->expected(0, 1)
      ->type_name("[CAMERAS]");
}

}  // namespace

void AddPoseChanges(CLI::App* sub, stages::PoseChanges& changes) {
  const GroupScope group(sub, "What the 2D joints mean");
  AddCameraSet(sub, "--normalized", changes.normalized,
               "coordinates are 0 to 1 of the image's width and height; of all cameras, or of those named, with commas");
  AddCameraSet(sub, "--flip-y", changes.flip_y, "y counts from the lower edge, as in DLTdv and Argus: y becomes height - y");
  AddCameraSet(sub, "--flip-x", changes.flip_x, "the images were mirrored: x becomes width - 1 - x");
  AddCameraSet(sub, "--swap-sides", changes.swap_sides,
               "left and right joints bear each other's name, as a detector calls them in mirrored images");
  AddChoices(sub, "--rotate", changes.rotate,
             "90, 180 or 270, or CAMERA=90: degrees clockwise by which the images were turned against the calibration's; the "
             "joints are turned back");
  AddChoices(
      sub, "--image-size", changes.image_size,
      "WIDTHxHEIGHT, or CAMERA=WIDTHxHEIGHT: of the images in which the joints were found, where they are scaled against "
      "the calibrated ones");
  AddChoices(sub, "--rate", changes.rate,
             "HZ, or CAMERA=HZ: frames a second, where cameras differ; time steps count at HZ, else at the lowest");
  AddOption(sub, "--frames", changes.frames, "80-99 or 1,4,7-9: frames, as the files number them; all unless given");
  AddOption(sub, "--swap-cameras", changes.swap_cameras, "A,B: the 2D joints of these two cameras bear each other's name");
  AddOption(sub, "--without-camera", changes.without_cameras, "names of cameras, with commas, whose 2D joints are left out")
      ->delimiter(',');
  AddFlag(sub, "--ignore-scores", changes.ignore_scores, "every joint that has coordinates counts as seen with score 1");
}

void AddPoseArguments(CLI::App* sub, stages::PoseArguments& arguments) {
  const GroupScope input(sub, "Calibration and 2D joints");
  AddOption(sub, "--calib", arguments.calib, "calibration file: ours, Panoptic's, or any that calib convert reads")->required();
  AddChoices(sub, "--pose2d", arguments.pose2d,
             "NAME=FOLDER of OpenPose JSON files, or NAME=FILE with the results of a whole video: COCO, AlphaPose, MMPose, "
             "DeepLabCut (.h5, .csv), SLEAP (analysis .h5, .csv); repeat for each camera");
  AddOption(sub, "--points2d", arguments.points2d,
            "instead: table camera,frame,person,joint,x_px,y_px,score (CSV) of all cameras, for markers and animals, or "
            "caliscope's xy_TRACKER.csv");
  AddOption(sub, "--skeleton", arguments.skeleton,
            Join(geometry::SkeletonNames(), " | ") +
                ", or a file FILE.toml of your own (docs/formats.md); body25 unless given, of --points2d, DeepLabCut and SLEAP "
                "the joints in the file");
  AddOption(sub, "--without-joint", arguments.without_joints, "names of joints, with commas, whose detections are left out")
      ->delimiter(',');
  AddOption(sub, "--unit,--calib-unit", arguments.calib_unit,
            "m, cm, mm or in: of a calibration that names no unit; m unless given");
  AddPoseMendingOptions(sub, arguments.invert, arguments.mirror);
  AddPoseChanges(sub, arguments.changes);
}

void AddCornerArguments(CLI::App* sub, stages::CornerArguments& arguments) {
  const GroupScope boards(sub, "Boards and footage");
  AddChoices(sub, "--board", arguments.boards,
             "chessboard:COLSxROWS:SQUARE (inner corners), charuco:COLSxROWS:SQUARE:MARKER[:DICT], aprilgrid:…, tag:… or "
             "grid:… (docs/boards.md); repeat for boards that are fixed to each other");
  AddChoices(sub, "--camera", arguments.cameras, "NAME=PATH: a video, a folder or a pattern in quotes; repeat for each camera");
  AddOption(sub, "--corners", arguments.corners, "a file of corners found before, instead of footage (docs/corner-files.md)");
  AddOption(sub, "--mirrored", arguments.mirrored,
            "names of cameras, with commas, whose images are flipped left-right: they are calibrated as if they were not")
      ->delimiter(',');
  AddOption(sub, "--timestamps", arguments.timestamps,
            "table of the frames' times on one clock (CSV, docs/formats.md): boards are paired by time, not by number");
  AddOptions(sub, arguments.footage);
  AddOptions(sub, arguments.corner_files);
}

}  // namespace mvstudio::cli
