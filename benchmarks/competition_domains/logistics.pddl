; Packages go by truck within a city and by airplane between airports.
(define (domain logistics)
  (:requirements :strips :typing)
  (:types place city item - object
          airport - place
          package vehicle - item
          truck airplane - vehicle)
  (:predicates (at ?item - item ?place - place) (inside ?package - package ?vehicle - vehicle)
               (in-city ?place - place ?city - city))
  (:action load
    :parameters (?package - package ?vehicle - vehicle ?place - place)
    :precondition (and (at ?package ?place) (at ?vehicle ?place))
    :effect (and (inside ?package ?vehicle) (not (at ?package ?place))))
  (:action unload
    :parameters (?package - package ?vehicle - vehicle ?place - place)
    :precondition (and (inside ?package ?vehicle) (at ?vehicle ?place))
    :effect (and (at ?package ?place) (not (inside ?package ?vehicle))))
  (:action drive
    :parameters (?truck - truck ?from ?to - place ?city - city)
    :precondition (and (at ?truck ?from) (in-city ?from ?city) (in-city ?to ?city))
    :effect (and (at ?truck ?to) (not (at ?truck ?from))))
  (:action fly
    :parameters (?airplane - airplane ?from ?to - airport)
    :precondition (at ?airplane ?from)
    :effect (and (at ?airplane ?to) (not (at ?airplane ?from)))))
