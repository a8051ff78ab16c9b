// Closed-form solvers of two-view motion, all of them: motions that are told by a homography, ũ' ~ H ũ, and by an
// epipolar geometry, ũ'ᵀ F ũ = 0; ũ = (u, 1).
//
// A match is (u.x, u.y, u'.x, u'.y) in normalised coordinates, u = (p - c)/f; * marks solvers that know nothing of the
// camera and take any coordinates. Each takes its minimal number of matches or, but for those marked =, more; with more
// it solves linear or closed-form least squares, a start for an estimator that knows the noise of each match. Fixed
// sizes, no allocation, no exceptions.
//
//   matches  solver                       H
//   1   *    solveRetinalTranslation      [I τ; 0 1]
//   1        solveZoom                    diag(s, s, 1): about the centre c of the image; s > 0
//   2   *    solveRetinalDisplacement     [Q τ; 0 1], Q a turn in the image
//   2   *    solveFreeZoom                [s I τ; 0 1], s > 0
//   2   *    solveSimilarity              [s Q τ; 0 1], s > 0
//   3   *    solveAffine                  [A τ; 0 1], det A > 0
//   2        solveRotation                R: the camera turns
//   2   =    solveRotationZoom            diag(r, r, 1) R: it turns and its focal length changes by r; up to two
//   4   *    solveHomography              any, det H > 0, ‖H‖² = 3
//
//   matches  solver                       F, ‖F‖² = 2
//   2        solveTranslation             [t]×: x' = x + t, with the sign that puts most points in front
//   3   =    solveEssentialUpright        [t]× R, the vertical known in both views: up to four
//   4   *    solveAffineEpipolar          zero but for F13, F23, F31, F32, F33: two affine cameras
//   5   =    solveEssential               [t]× R: up to ten
//   7   =    solveSharedFocal             K⁻ᵀ [t]× R K⁻¹, one focal length of both views, with the pose: up to three
//   7   *    solveFundamental             det F = 0: up to three; of eight or more one
//
// A solver gives no solution for a sample that does not determine it, told without a scale: points that agree to
// sixteen roundings of their coordinates where two are needed; a triangle whose area is below 1e-9 of the square of the
// sample's extent (affine, homography); bearings within 1e-9 rad (rotation); matches that move by less than 1e-12 rad,
// or all along one epipolar line to 1e-9 (translation); an equation that depends on the others to 1e-12 of its size, or
// normal equations that lack a second direction to 1e-13 of their trace; what is not finite; fewer matches than needed.
#pragma once

#include <fusion/two_view/epipolar_solvers.hpp>
#include <fusion/two_view/five_point.hpp>
#include <fusion/two_view/homography_solvers.hpp>
#include <fusion/two_view/image_motion_solvers.hpp>
#include <fusion/two_view/rotation_solvers.hpp>
#include <fusion/two_view/shared_focal.hpp>
#include <fusion/two_view/upright.hpp>
