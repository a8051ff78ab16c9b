// Orientations of crystals from maps of electron backscatter diffraction: EDAX's .ang and Oxford Instruments' .ctf
// texts.
//
//   const EbsdFile map = readEbsdFile("map.ctf");
//   const std::vector<CrystalOrientation> grains = map.orientationsOf(map.phases[0]);
//
// Both have Bunge's angles, of the rotation from the sample's axes to the crystal's: .ang in rad, .ctf in degrees. A
// row is turned into the inverse (lie/crystal_orientation.hpp). The axes of hexagonal and trigonal crystals differ:
// .ang has x along a, .ctf along a*. The axes of the sample are those of the angles in the file; between these and the
// axes of the map programs turn in different ways, of which a file says nothing.
#pragma once

#include <lie/crystal_orientation.hpp>

#include <cstddef>
#include <optional>
#include <string>
#include <vector>

namespace liestat {

/// A phase of a map.
struct EbsdPhase {
  int number = 0;                        ///< in the rows of the file
  std::string name;                      ///< made fit for a terminal
  std::string symmetry;                  ///< the Laue class, or the code of the file if it is unknown
  std::optional<PointGroup> group = {};  ///< its rotations; nothing for an unknown code
  std::size_t n = 0;                     ///< points of this phase
};

/// The points of a map that were indexed, in the order of the file.
struct EbsdFile {
  std::string format;  ///< ang or ctf
  std::vector<EbsdPhase> phases;
  std::vector<SO3d> rotations;  ///< from the crystal's axes to the sample's
  std::vector<int> phase;       ///< number of the phase of each
  std::vector<std::size_t> lines;
  std::size_t n_unindexed = 0;  ///< .ang: confidence below 0 or angles of 4π; .ctf: phase 0

  /// The axes that `group` of a phase supposes.
  HexagonalAxes axes() const { return format == "ang" ? HexagonalAxes::x_along_a : HexagonalAxes::x_along_a_star; }
  /// The points of a phase; of the trivial group if that of the phase is unknown.
  std::vector<CrystalOrientation> orientationsOf(const EbsdPhase& of) const {
    std::vector<CrystalOrientation> list;
    for (std::size_t i = 0; i < rotations.size(); ++i) {
      if (phase[i] == of.number) list.emplace_back(rotations[i], of.group.value_or(PointGroup()));
    }
    return list;
  }
};

/// True if a file's name ends in .ang or .ctf, in whatever case.
bool isEbsdName(const std::string& path);

/// Reads a map from a file whose name says which format it is, of at most `largest_file` GB. Throws InputError.
EbsdFile readEbsdFile(const std::string& path, std::optional<double> largest_file = {});

}  // namespace liestat
